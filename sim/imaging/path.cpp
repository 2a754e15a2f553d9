#include "sim/imaging/path.h"

#include "sim/imaging/tracer.h"

namespace lumen {

PathCount RenderFrame(const PathScene& scene, const View& view, const PathOptions& options, uint64_t seed,
                      int frame, bool with_parts, Film* film) {
  if (scene.surface->subsurface) return RenderTissue(scene, view, options, seed, frame, with_parts, film);
  return scene.surface->coat ? Tracer<true, false>(scene, view, options, seed, frame).Run(with_parts, film)
                             : Tracer<false, false>(scene, view, options, seed, frame).Run(with_parts, film);
}

}  // namespace lumen
