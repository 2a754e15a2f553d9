// A plain path tracer that the fast one is held against: one ray at a time, a path of its own for each sample
// of each pixel, every guide with its shadow ray at every place. Only what finds the triangle that a ray
// meets, the textures (albedo, the coat's relief), the table of what the coat reflects in all, the walks
// through tissue and the random numbers are shared with path.h; what follows of a place, its light and the
// next direction is written out again.
#pragma once

#include <cstdint>
#include <string>

#include "common/image.h"
#include "sim/imaging/path.h"

namespace lumen {

// The first effect that the plain tracer doesn't know: "shutter" or "defocus"; "" if it can render the scene.
std::string MissingInReference(bool has_shutter, bool has_defocus);

// Linear radiance, RGB, of one frame, as RenderFrame gives it up to noise; what is not finite is left as it
// is. T: float or double, that places, directions and light are computed in; rays are float in either, and in
// double only the triangle that they find counts. options.shared_paths has no meaning here. Throws InputError
// for an effect that it doesn't know.
template <class T>
ImageF RenderReference(const PathScene& scene, const View& view, const PathOptions& options, uint64_t seed,
                       int frame);

}  // namespace lumen
