// How sequences look, in figures: C3VD's real frame against what other programs counted in it.
#include "recon/photometry/looks.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support.h"

namespace lumen::test {
namespace {

constexpr char kFrame[] = "c3vd/trans_t4_a_frame0010";

Looks RealLooks() {
  const Sequence sequence = ReadSequence(SharedData(kFrame));
  PhotometryOptions options;
  options.max_pixels = 100'000;
  return LooksOf(sequence, FitPhotometry(Observe(sequence, options), options));
}

double FigureOf(const Looks& looks, const std::string& name) {
  const auto found = std::ranges::find(looks.figures, name, &LookFigure::name);
  return found == looks.figures.end() ? -1 : found->value;
}

// Percentiles within the official mask, counted elsewhere; C3VD's octagon here is drawn, half a pixel off.
TEST(Looks, RealFramesPercentiles) {
  LUMEN_NEEDS_DATA(kFrame);
  const Looks looks = RealLooks();
  const int expected[3][7] = {
      {81, 125, 194, 235, 255, 255, 255}, {38, 59, 92, 122, 160, 233, 255}, {35, 54, 84, 113, 150, 218, 253}};
  const char* channels[] = {"red", "green", "blue"};
  const char* percents[] = {"1", "5", "25", "50", "75", "95", "99"};
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < 7; ++i) {
      EXPECT_NEAR(FigureOf(looks, std::string(channels[c]) + " p" + percents[i]), expected[c][i], 1);
    }
  }
  EXPECT_NEAR(FigureOf(looks, "green saturated %"), 3.2, 0.06);
  EXPECT_NEAR(FigureOf(looks, "blue saturated %"), 1.2, 0.06);
  EXPECT_NEAR(FigureOf(looks, "white %"), 1.2, 0.06);
}

TEST(Looks, LikeItselfAndUnlikeADarkerOne) {
  LUMEN_NEEDS_DATA(kFrame);
  const Looks looks = RealLooks();
  for (const LookDifference& one : CompareLooks(looks, looks, 0.01)) EXPECT_TRUE(one.within) << one.name;
  Looks darker = looks;
  for (LookFigure& figure : darker.figures) figure.value *= 0.7;
  for (const LookDifference& one : CompareLooks(darker, looks, 0.25)) EXPECT_FALSE(one.within) << one.name;
  for (const LookDifference& one : CompareLooks(darker, looks, 0.35)) EXPECT_TRUE(one.within) << one.name;
}

}  // namespace
}  // namespace lumen::test
