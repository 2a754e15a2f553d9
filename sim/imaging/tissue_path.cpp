#include "sim/imaging/tracer.h"

namespace lumen {

PathCount RenderTissue(const PathScene& scene, const View& view, const PathOptions& options, uint64_t seed,
                       int frame, bool with_parts, Film* film) {
  return scene.surface->coat ? Tracer<true, true>(scene, view, options, seed, frame).Run(with_parts, film)
                             : Tracer<false, true>(scene, view, options, seed, frame).Run(with_parts, film);
}

}  // namespace lumen
