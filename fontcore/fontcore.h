#pragma once

// All of fontcore in stacking order: a file includes only files above it.
// clang-format off
#include "fontcore/error.h"
#include "fontcore/contour.h"
#include "fontcore/measure.h"
#include "fontcore/alignment.h"
#include "fontcore/crossing.h"
#include "fontcore/ink.h"
#include "fontcore/profile.h"
#include "fontcore/wavelet.h"
#include "fontcore/nonuniform.h"
#include "fontcore/tensor.h"
#include "fontcore/outline_curve.h"
#include "fontcore/arcwise.h"
#include "fontcore/soften.h"
#include "fontcore/constraint.h"
#include "fontcore/solve.h"
#include "fontcore/edit.h"
#include "fontcore/drag.h"
#include "fontcore/fit.h"
#include "fontcore/compact.h"
#include "fontcore/degree.h"
#include "fontcore/rounding.h"
#include "fontcore/stroke.h"
#include "fontcore/weight.h"
// clang-format on
