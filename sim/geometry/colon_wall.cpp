#include "sim/geometry/colon_wall.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/random.h"

namespace lumen {
namespace {

constexpr double kSector_rad = 2 * kPi / 3;
constexpr int kWaves = 40;
// Folds keep this many thicknesses away from the rounded ends.
constexpr double kFoldMargin = 1.5;
// Largest relative deviation of a fold's height from the nominal one.
constexpr double kHeightSpread = 0.2;
// How far the rounded triangle's corners are rounded, in heights of its folds.
constexpr double kRounding = 0.3;
// Noise is a sum of kWaves cosines with equal amplitudes: never beyond this many root mean squares.
const double kNoiseBound = std::sqrt(2.0 * kWaves);

// What a random number is drawn for.
enum Draw : uint64_t { kTaenia = 1, kFoldPlace, kFoldHeight, kFoldTilt, kFoldBow, kSectorShift, kWaveDraw };

// In [−1, 1).
double Signed(uint64_t seed, uint64_t draw, uint64_t a, uint64_t b = 0) {
  return 2 * UniformDouble(RandomBits(seed, draw, a, b)) - 1;
}

double Smoothstep(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// 1 at 0, 0 with zero slope from |x| = 1 on.
double Bump(double x) {
  const double t = std::max(0.0, 1 - x * x);
  return t * t;
}

double WrappedAngle(double angle) { return std::remainder(angle, 2 * kPi); }

// max(x, 0) with its corner rounded over about `width`.
double SmoothPositive(double x, double width) { return 0.5 * (x + std::sqrt(x * x + width * width)); }

// A polyp's outline as a curve from its top (t = 0) to its foot (t = 1): distance from its axis, height over
// the wall.
struct OutlinePoint {
  double from_axis_mm, height_mm;
};

// A ball on a stalk that widens into the wall by a quarter circle. All lengths in units of the ball's radius.
struct Stalk {
  static constexpr double kRadius = 0.4, kFillet = 0.45, kTop = 1.1;
  static double BallCentre() { return kTop + std::sqrt(1 - kRadius * kRadius); }
};

OutlinePoint PedunculatedOutline(double ball_mm, double t) {
  const double ball_arc = kPi - std::asin(Stalk::kRadius);  // from the top of the ball to the stalk
  const double stalk = Stalk::kTop - Stalk::kFillet, fillet = Stalk::kFillet * kPi / 2;
  const double arc = t * (ball_arc + stalk + fillet);
  if (arc < ball_arc) return {ball_mm * std::sin(arc), ball_mm * (Stalk::BallCentre() + std::cos(arc))};
  if (arc < ball_arc + stalk) return {ball_mm * Stalk::kRadius, ball_mm * (Stalk::kTop - (arc - ball_arc))};
  const double turn = (arc - ball_arc - stalk) / Stalk::kFillet;
  return {ball_mm * (Stalk::kRadius + Stalk::kFillet * (1 - std::cos(turn))),
          ball_mm * Stalk::kFillet * (1 - std::sin(turn))};
}

OutlinePoint Outline(const Polyp& polyp, double t) {
  const double foot = ColonWall::FootRadius(polyp), height = ColonWall::Height(polyp);
  switch (polyp.paris) {
    case Polyp::Paris::kIp:
      return PedunculatedOutline(polyp.size_mm / 2, t);
    case Polyp::Paris::kIs:
      return {foot * t, height * std::pow(1 - t * t * t, 2)};
    case Polyp::Paris::kIIa:
      return {foot * t, height * std::pow(1 - std::pow(t, 6), 2)};
  }
  return {foot * t, 0};
}

}  // namespace

ColonWall::ColonWall(const ColonShape& shape, Centreline centreline)
    : shape_(shape), centreline_(std::move(centreline)), length_mm_(centreline_.length_mm()) {
  taenia_rad_ = kPi * Signed(shape_.seed, kTaenia, 0);
  PlaceFolds();
  DrawWaves();
}

// The folds of the three sectors alternate along the colon, each sector's a third of the spacing behind the
// last's.
void ColonWall::PlaceFolds() {
  const double spacing = shape_.haustra_spacing_mm, margin = kFoldMargin * shape_.fold_thickness_mm;
  const int count = static_cast<int>(std::ceil(length_mm_ / spacing)) + 4;
  for (uint64_t sector = 0; sector < 3; ++sector) {
    const double shift = spacing * (sector / 3.0 + 0.08 * Signed(shape_.seed, kSectorShift, sector));
    for (int i = 0; i < count; ++i) {
      Fold fold;
      fold.at_mm = spacing * (i - 2 + 0.12 * Signed(shape_.seed, kFoldPlace, sector, i)) + shift;
      fold.height_mm =
          shape_.fold_height_mm * (1 + kHeightSpread * Signed(shape_.seed, kFoldHeight, sector, i));
      fold.tilt_mm = 0.08 * spacing * Signed(shape_.seed, kFoldTilt, sector, i);
      fold.bow_mm = 0.08 * spacing * Signed(shape_.seed, kFoldBow, sector, i);
      // Those beyond the tube only end the haustra that reach over its ends.
      if (fold.at_mm < margin || fold.at_mm > length_mm_ - margin) fold.height_mm = 0;
      folds_[sector].push_back(fold);
    }
  }
}

// Wave-lengths of 8–40 mm in directions spread evenly over the wall.
void ColonWall::DrawWaves() {
  const double mean_radius = Radius(length_mm_ / 2);
  for (int i = 0; i < kWaves; ++i) {
    const double wavelength = 8 * std::pow(5.0, 0.5 + 0.5 * Signed(shape_.seed, kWaveDraw, i, 0));
    const double heading = kPi * Signed(shape_.seed, kWaveDraw, i, 1);
    Wave wave;
    wave.amplitude_mm = shape_.irregularity_mm * std::sqrt(2.0 / kWaves);
    wave.around = static_cast<int>(std::lround(std::cos(heading) * 2 * kPi * mean_radius / wavelength));
    wave.along = std::sin(heading) * 2 * kPi / wavelength;
    wave.phase = kPi * Signed(shape_.seed, kWaveDraw, i, 2);
    waves_.push_back(wave);
  }
}

double ColonWall::Radius(double s_mm) const {
  const auto& diameters = shape_.diameters_mm;
  const double place = std::clamp(s_mm / length_mm_, 0.0, 1.0) * (diameters.size() - 1);
  const size_t i = std::min(static_cast<size_t>(place), diameters.size() - 1);
  const size_t next = std::min(i + 1, diameters.size() - 1);
  const double t = Smoothstep(0, 1, place - i);
  return 0.5 * (diameters[i] * (1 - t) + diameters[next] * t);
}

double ColonWall::FoldFade(double s_mm, double angle_rad) const {
  double fade = 1;
  for (const Polyp& polyp : shape_.polyps) {
    const double aside = Radius(polyp.at_mm) * WrappedAngle(angle_rad - polyp.angle_rad);
    const double clear = std::max(FootRadius(polyp), polyp.size_mm / 2) + 1;
    fade *= Smoothstep(clear, clear + 5, std::hypot(s_mm - polyp.at_mm, aside));
  }
  return fade;
}

double ColonWall::DistanceFromCentreline(double s_mm, double angle_rad) const {
  const double radius = Radius(s_mm);
  double distance = radius;
  for (const Wave& wave : waves_)
    distance += wave.amplitude_mm * std::cos(wave.around * angle_rad + wave.along * s_mm + wave.phase);

  const double turn = (angle_rad - taenia_rad_) / kSector_rad;
  const int sector = ((static_cast<int>(std::floor(turn)) % 3) + 3) % 3;
  const double from_middle = (turn - std::floor(turn) - 0.5) * kSector_rad;  // in ±60°
  const double to_taenia = kSector_rad / 2 - std::abs(from_middle);
  const double taenia_half = shape_.taenia_width_mm / 2 / radius;
  distance -= shape_.taenia_depth_mm * Bump(to_taenia / taenia_half);

  const double fade = FoldFade(s_mm, angle_rad);
  const double aside = from_middle / (kSector_rad / 2);
  const double between_taeniae = Smoothstep(0.3 * taenia_half, taenia_half + 0.3, to_taenia);
  const double sigma = shape_.fold_thickness_mm / (2 * std::sqrt(2 * std::log(2.0)));
  const auto& folds = folds_[sector];
  const auto place = [&](const Fold& fold) {
    return fold.at_mm + fold.tilt_mm * aside + fold.bow_mm * (aside * aside - 0.5);
  };
  for (size_t i = 0; i < folds.size(); ++i) {
    const double from_fold = s_mm - place(folds[i]);
    if (folds[i].height_mm > 0 && std::abs(from_fold) < 8 * sigma) {
      // The crest is a chord of the wall's circle: three of them make the rounded triangle.
      const double height = folds[i].height_mm;
      const double chord = radius - (radius - height) / std::cos(from_middle);
      const double crest =
          height * SmoothPositive(chord, kRounding * height) / SmoothPositive(height, kRounding * height);
      distance -= fade * between_taeniae * crest * std::exp(-0.5 * std::pow(from_fold / sigma, 2));
    }
    if (i + 1 < folds.size() && from_fold >= 0) {
      const double length = place(folds[i + 1]) - place(folds[i]);
      const double ends = Smoothstep(-0.3 * radius, 0.3 * radius, s_mm) *
                          Smoothstep(-0.3 * radius, 0.3 * radius, length_mm_ - s_mm);
      if (from_fold < length)
        distance += ends * fade * between_taeniae * shape_.haustra_depth_mm *
                    std::pow(std::sin(kPi * from_fold / length), 2);
    }
  }
  return distance;
}

Vec3d ColonWall::AtPlace(const Place& place, double scale) const {
  const CentrelineFrame frame = centreline_.At(place.s_mm);
  const double distance = scale * DistanceFromCentreline(place.s_mm, place.angle_rad);
  return frame.point +
         distance * (std::cos(place.angle_rad) * frame.normal + std::sin(place.angle_rad) * frame.binormal);
}

Vec3d ColonWall::At(const Vec3d& capsule) const {
  const double scale = std::hypot(capsule.x(), capsule.y());
  Place place = {capsule.z(), scale > 0 ? std::atan2(capsule.y(), capsule.x()) : 0};
  for (const Polyp& polyp : shape_.polyps) {
    const double foot = FootRadius(polyp), radius = Radius(polyp.at_mm);
    const double along = place.s_mm - polyp.at_mm;
    const double aside = radius * WrappedAngle(place.angle_rad - polyp.angle_rad);
    const double from_axis = std::hypot(along, aside);
    if (from_axis >= foot) continue;
    // The wall under the polyp is drawn together to its outline, then lifted along the polyp's axis.
    const OutlinePoint outline = Outline(polyp, from_axis / foot);
    const double draw = from_axis > 0 ? outline.from_axis_mm / from_axis : 0;
    place = {polyp.at_mm + draw * along, polyp.angle_rad + draw * aside / radius};
    const CentrelineFrame frame = centreline_.At(polyp.at_mm);
    const Vec3d outward =
        std::cos(polyp.angle_rad) * frame.normal + std::sin(polyp.angle_rad) * frame.binormal;
    return AtPlace(place, scale) - outline.height_mm * outward;
  }
  return AtPlace(place, scale);
}

Vec3d ColonWall::OntoCapsule(const Vec3d& near) const {
  const double past = near.z() < 0 ? near.z() : std::max(0.0, near.z() - length_mm_);
  const double height = near.z() < 0 ? NearCapHeight() : DeepCapHeight();
  const Vec3d direction = Vec3d(near.x(), near.y(), past / height).normalized();
  return {direction.x(), direction.y(), near.z() - past + direction.z() * height};
}

double ColonWall::OuterRadius() const {
  const double widest = *std::max_element(shape_.diameters_mm.begin(), shape_.diameters_mm.end()) / 2;
  return widest + shape_.haustra_depth_mm + kNoiseBound * shape_.irregularity_mm;
}

double ColonWall::InnerRadius() const {
  const double narrowest = *std::min_element(shape_.diameters_mm.begin(), shape_.diameters_mm.end()) / 2;
  return narrowest - shape_.taenia_depth_mm - (1 + kHeightSpread) * shape_.fold_height_mm -
         kNoiseBound * shape_.irregularity_mm;
}

double ColonWall::FootRadius(const Polyp& polyp) {
  // At half its height a sessile polyp has 0.66 of its foot's radius, a flat one 0.82.
  if (polyp.paris == Polyp::Paris::kIp) return polyp.size_mm / 2 * (Stalk::kRadius + Stalk::kFillet);
  return 0.6 * polyp.size_mm;
}

double ColonWall::Height(const Polyp& polyp) {
  switch (polyp.paris) {
    case Polyp::Paris::kIp:
      return polyp.size_mm / 2 * (Stalk::BallCentre() + 1);
    case Polyp::Paris::kIs:
      return 0.55 * polyp.size_mm;
    case Polyp::Paris::kIIa:
      return std::min(2.4,
                      0.2 * polyp.size_mm);  // flat by definition: less than a closed biopsy forceps, 2.5 mm
  }
  return 0;
}

}  // namespace lumen
