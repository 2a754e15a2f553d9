// A scene file as plain values: everything that a render depends on, besides the seed.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/sequence.h"
#include "sim/geometry/geometry.h"
#include "sim/geometry/peristalsis.h"
#include "sim/imaging/chromatic_aberration.h"
#include "sim/imaging/defocus.h"
#include "sim/imaging/path.h"
#include "sim/imaging/sensor.h"
#include "sim/imaging/surface.h"

namespace lumen {

struct TruthOptions {
  bool c3vd = true;  // depth, normals, flow, occlusion in C3VD's encodings
  // Channels of exact/NNNN.exr; "visibility": exact/visibility.ply; "mesh": exact/NNNN_mesh.ply.
  std::vector<std::string> exact;
};

struct Scene {
  Calibration calibration;
  Geometry geometry;  // at rest
  std::optional<Peristalsis> peristalsis;
  std::vector<Pose> world_from_camera;
  bool path_is_stand_in = false;  // the recorded poses that the scene names are absent
  Surface surface;
  PathOptions path;
  std::optional<Defocus> defocus;
  std::optional<ChromaticAberration> chromatic_aberration;
  Sensor sensor;
  TruthOptions truth;
  std::vector<std::string> effects;  // that the scene names, for reports
};

// Reads a scene file (scenes/README.md), with its base, and builds its geometry and trajectory. settings:
// "path.to.key=value". Throws InputError with file, line and remedy.
Scene ReadScene(const std::filesystem::path& file, const std::vector<std::string>& settings, uint64_t seed);

// Names that [truth] exact may hold.
const std::vector<std::string>& ExactChannels();

}  // namespace lumen
