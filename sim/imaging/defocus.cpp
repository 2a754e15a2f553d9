#include "sim/imaging/defocus.h"

#include <cmath>

namespace lumen {

Defocus ReadDefocus(const ConfigTable& table) {
  Defocus defocus;
  defocus.aperture_mm = table.Number("aperture_mm", defocus.aperture_mm, {0, 2});
  defocus.focus_mm = table.Number("focus_mm", defocus.focus_mm, kPositive);
  return defocus;
}

LensRay ThroughLens(const Defocus& defocus, const Vec3f& direction, const Vec2f& random) {
  const float radius = static_cast<float>(defocus.aperture_mm / 2) * std::sqrt(random.x());
  if (radius == 0) return {Vec3f::Zero(), direction};  // to the last bit
  const float angle = static_cast<float>(2 * kPi) * random.y();
  const Vec3f origin(radius * std::cos(angle), radius * std::sin(angle), 0);
  // Divided by the focus, so that one at infinity is possible.
  return {origin, (direction - origin / static_cast<float>(defocus.focus_mm)).normalized()};
}

}  // namespace lumen
