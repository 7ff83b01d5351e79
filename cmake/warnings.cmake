# What every target of the project is compiled with.
add_library(project_warnings INTERFACE)
target_compile_options(project_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion
                       -Wnon-virtual-dtor -Wold-style-cast -Woverloaded-virtual $<$<BOOL:${GLYPHWAVE_WERROR}>:-Werror>)
# Options structs are filled in part by name; and g++ 12 sees overlaps in adding strings that are not there (its bug 105651).
target_compile_options(project_warnings INTERFACE -Wno-missing-field-initializers $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
# Only the LGPL parts of CGAL and the MPL2 parts of Eigen: anything else would choose our licence.
target_compile_definitions(project_warnings INTERFACE CGAL_LICENSE_ERROR=1 EIGEN_MPL2_ONLY)
# The same result on every machine of an architecture: no contraction of a*b+c that a compiler may choose or not.
target_compile_options(project_warnings INTERFACE -ffp-contract=off)
if(GLYPHWAVE_SANITIZE)
  add_compile_options(-fsanitize=${GLYPHWAVE_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${GLYPHWAVE_SANITIZE})
endif()
if(GLYPHWAVE_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link)
  add_link_options(-fsanitize=fuzzer-no-link)
endif()
