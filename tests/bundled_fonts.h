#pragma once

#include <string>
#include <vector>

/// The fonts under fonts/, by path.
inline std::string bundled_font(const std::string& name) {
  return std::string(GLYPHWAVE_SOURCE_DIR) + "/fonts/" + name;
}

inline const std::vector<std::string> bundled_ttf{bundled_font("liberation-serif/LiberationSerif-Regular.ttf"),
                                                  bundled_font("liberation-serif/LiberationSerif-Bold.ttf"),
                                                  bundled_font("open-sans/OpenSans-Regular.ttf"),
                                                  bundled_font("open-sans/OpenSans-Bold.ttf")};

inline const std::vector<std::string> bundled_otf{
    bundled_font("cabin/Cabin-Regular.otf"), bundled_font("cabin/Cabin-Bold.otf"),
    bundled_font("eb-garamond/EBGaramond12-Regular.otf"), bundled_font("eb-garamond/EBGaramond12-Bold.otf")};

inline std::vector<std::string> bundled_fonts() {
  std::vector<std::string> all = bundled_ttf;
  all.insert(all.end(), bundled_otf.begin(), bundled_otf.end());
  return all;
}

#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool is_sanitized = true;
#elif defined(__has_feature)
inline constexpr bool is_sanitized = __has_feature(address_sanitizer);
#else
inline constexpr bool is_sanitized = false;
#endif

/// All of them; under sanitizers, where the work on each takes many times as long, one of TrueType and one of CFF.
inline std::vector<std::string> bundled_fonts_for_long_work() {
  return is_sanitized ? std::vector{bundled_ttf[0], bundled_otf[0]} : bundled_fonts();
}

inline const std::string letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
