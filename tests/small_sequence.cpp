#include "tests/small_sequence.h"

#include "common/progress.h"
#include "sim/render.h"

namespace lumen::test {

const Sequence& SmallSequence() {
  static const ScratchFolder folder;
  static const Sequence sequence = [] {
    SetQuiet(true);
    const Scene scene = ReadScene(LUMEN_SOURCE_FOLDER "/scenes/colon.toml",
                                  {"camera.width=90", "camera.height=72", "trajectory.frames=6",
                                   "path.samples=1", "geometry.tolerance_mm=0.3", "truth.c3vd=false"},
                                  0);
    RenderOptions options;
    options.folder = folder / "sequence";
    Render(scene, options);
    return ReadSequence(options.folder);
  }();
  return sequence;
}

}  // namespace lumen::test
