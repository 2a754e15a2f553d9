#include "sim/scene.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/calibration.h"
#include "common/config.h"
#include "common/error.h"
#include "common/parallel.h"
#include "common/progress.h"
#include "common/random.h"
#include "sim/geometry/clearance.h"
#include "sim/geometry/moving_wall.h"
#include "sim/trajectory/recorded_path.h"
#include "sim/trajectory/trajectory.h"

namespace lumen {
namespace {

constexpr Range kImageSide{1, 32768};

// Seeds of the parts of a scene, so that none repeats another's numbers.
enum : uint64_t { kGeometrySeed = 1, kTrajectorySeed = 2, kVesselSeed = 3 };

CameraIntrinsics ReadSceneCamera(const ConfigTable& table) {
  if (!table.Has("preset")) return ReadCamera(table);
  const std::string preset = table.Choice("preset", {"c3vd", "endomapper"});
  const CameraIntrinsics camera = preset == "c3vd" ? C3vdIntrinsics() : EndomapperIntrinsics();
  const int width = static_cast<int>(table.Integer("width", camera.width, kImageSide));
  const int height = static_cast<int>(table.Integer("height", camera.height, kImageSide));
  if (width == camera.width && height == camera.height) return camera;
  try {
    return Resized(camera, width, height);
  } catch (const InputError& error) {
    table.Fail("width", error.what());
  }
}

Image8 ReadMask(const ConfigTable& table, const CameraIntrinsics& camera) {
  if (!table.Has("mask")) return {};
  if (table.String("mask") == "octagon") return C3vdOctagon(camera.width, camera.height);
  const Image8 mask = ReadImage8(table.Path("mask"), 1);
  if (mask.width == camera.width && mask.height == camera.height) return mask;
  // The nearest pixel of a mask of another size: it is drawn for the camera at its full one.
  Image8 resized(camera.width, camera.height, 1);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      *resized.Pixel(x, y) = *mask.Pixel(static_cast<int>((x + 0.5) * mask.width / camera.width),
                                         static_cast<int>((y + 0.5) * mask.height / camera.height));
    }
  }
  return resized;
}

PathOptions ReadPath(const ConfigTable& table) {
  PathOptions path;
  path.samples = static_cast<int>(table.Integer("samples", path.samples, {1, 1 << 24}));
  path.direct_oversampling =
      static_cast<int>(table.Integer("direct_oversampling", path.direct_oversampling, {1, 1 << 6}));
  path.bounces = static_cast<int>(table.Integer("bounces", path.bounces, {0, 10000}));
  path.roulette_after = static_cast<int>(table.Integer("roulette_after", path.roulette_after, {0, 10000}));
  path.shared_paths = static_cast<int>(table.Integer("shared_paths", path.shared_paths, {0, 4096}));
  if (table.Choice("sampler", "sobol", {"sobol", "independent"}) == "independent") {
    path.sampler = Sampling::kIndependent;
  }
  return path;
}

TruthOptions ReadTruth(const ConfigTable& table) {
  TruthOptions truth;
  truth.c3vd = table.Flag("c3vd", truth.c3vd);
  if (!table.Has("exact")) return truth;
  truth.exact = table.Strings("exact");
  for (const std::string& name : truth.exact) {
    if (std::find(ExactChannels().begin(), ExactChannels().end(), name) != ExactChannels().end()) continue;
    std::string known;
    for (const std::string& channel : ExactChannels()) known += (known.empty() ? "" : ", ") + channel;
    table.Fail("exact", "no channel \"" + name + "\"; there are: " + known);
  }
  return truth;
}

std::vector<std::string> NameEffects(const Scene& scene) {
  std::vector<std::string> effects;
  if (scene.peristalsis) effects.push_back("peristalsis");
  if (scene.path.bounces > 0) effects.push_back("interreflection");
  if (scene.surface.mottling) effects.push_back("mottling");
  if (scene.surface.vessels) effects.push_back("vessels");
  if (scene.surface.subsurface) effects.push_back("subsurface");
  if (scene.surface.coat) effects.push_back("coat");
  const auto& sources = scene.calibration.light.sources;
  if (std::any_of(sources.begin(), sources.end(), [](const auto& s) { return !s.position.isZero(0); })) {
    effects.push_back("offset_guides");
  }
  if (scene.calibration.response.vignetting > 0) effects.push_back("vignetting");
  if (scene.defocus) effects.push_back("defocus");
  if (scene.chromatic_aberration) effects.push_back("chromatic_aberration");
  if (scene.sensor.shutter) effects.push_back("shutter");
  if (scene.sensor.auto_gain) effects.push_back("auto_gain");
  if (scene.sensor.noise) effects.push_back("sensor_noise");
  if (scene.sensor.jpeg) effects.push_back("jpeg");
  if (!scene.calibration.mask.empty()) effects.push_back("mask");
  return effects;
}

[[noreturn]] void RefuseFrame(const std::filesystem::path& file, size_t frame, const std::string& why) {
  throw InputError(file.string() + ": frame " + std::to_string(frame) + ": " + why);
}

// A guide in the wall would light it from within.
bool LightBehindWall(const Light& light, const Pose& world_from_camera, const RayScene& wall,
                     float time = 0) {
  const Vec3f from = wall.ToLocal(world_from_camera.translation());
  return std::any_of(light.sources.begin(), light.sources.end(), [&](const LightSource& source) {
    return !source.position.isZero(0) &&
           wall.Occluded(from, wall.ToLocal(world_from_camera * source.position) - from, 0, 1, time);
  });
}

// A wall that moves while a frame is taken is asked at the steps between which it goes straight on, as the
// camera does; that may turn at the frame's moment, which is checked apart.
void CheckWhileTaken(const Scene& scene, const MovingWall& walls, int frame,
                     const std::filesystem::path& file) {
  const double duration = scene.sensor.shutter->Duration();
  const auto motion = walls.During(frame, duration);
  if (!motion) return;
  const CameraMotion camera(*scene.sensor.shutter, scene.world_from_camera, frame);
  const double last = static_cast<double>(motion->steps.size() - 1);
  for (size_t step = 0; step < motion->steps.size(); ++step) {
    const double part = static_cast<double>(step) / last;
    const Pose pose = camera.At(duration * (part - 0.5));
    if (!Clearance(motion->steps[step]).Encloses(pose.translation())) {
      RefuseFrame(
          file, frame,
          "while it is taken the contracted wall passes the camera; keep it nearer to the centreline, "
          "lower peristalsis.amplitude or shorten sensor.shutter.exposure");
    }
    if (LightBehindWall(scene.calibration.light, pose, motion->rays, static_cast<float>(part))) {
      RefuseFrame(
          file, frame,
          "while it is taken a light source lies behind the wall; keep the camera farther from it "
          "(trajectory.clearance_mm), lower peristalsis.amplitude or shorten sensor.shutter.exposure");
    }
  }
}

void CheckStretches(const Scene& scene, const MovingWall& walls, const std::filesystem::path& file) {
  const double frames = scene.sensor.shutter->Duration();
  if (walls.StretchesOver(frames) <= MovingWall::kMostStretches) return;
  const double way_mm = std::abs(scene.peristalsis->speed_mm_s) * frames / scene.peristalsis->rate_hz;
  char number[32];
  std::snprintf(number, sizeof(number), "%.4g", way_mm);
  throw InputError(file.string() + ": peristalsis: its rings travel " + number +
                   " mm while a frame is taken, too far to be followed in " +
                   std::to_string(MovingWall::kMostStretches) +
                   " steps; lower peristalsis.speed_mm_s or sensor.shutter.exposure and readout, or raise "
                   "peristalsis.rate_hz");
}

// The trajectory has been found clear of the wall at rest.
void CheckEndoscopeInLumen(const Scene& scene, const std::filesystem::path& file) {
  MovingWall walls(scene.geometry, {scene.peristalsis});
  if (scene.sensor.shutter) CheckStretches(scene, walls, file);
  for (size_t frame = 0; frame < scene.world_from_camera.size(); ++frame) {
    const Pose& pose = scene.world_from_camera[frame];
    const auto wall = walls.At(static_cast<int>(frame));
    if (walls.moves() && !Clearance(wall->mesh()).Encloses(pose.translation())) {
      RefuseFrame(file, frame,
                  "the contracted wall has passed the camera; keep it nearer to the centreline or lower "
                  "peristalsis.amplitude");
    }
    if (LightBehindWall(scene.calibration.light, pose, wall->rays)) {
      RefuseFrame(file, frame,
                  std::string("a light source lies behind the wall; keep the camera farther from it "
                              "(trajectory.clearance_mm)") +
                      (walls.moves() ? " or lower peristalsis.amplitude" : ""));
    }
    if (scene.sensor.shutter) CheckWhileTaken(scene, walls, static_cast<int>(frame), file);
  }
}

}  // namespace

const std::vector<std::string>& ExactChannels() {
  static const std::vector<std::string> channels = {
      "radiance",    "direct",    "indirect",   "glint",          "subsurface", "albedo",
      "z",           "distance",  "normal",     "shading_normal", "position",   "flow",
      "seen_before", "flow_next", "seen_after", "visibility",     "mesh"};
  return channels;
}

Scene ReadScene(const std::filesystem::path& file, const std::vector<std::string>& settings, uint64_t seed) {
  const Config config = Config::ReadWithBase(file, settings);
  const ConfigTable root = config.root();
  Scene scene;
  const ConfigTable camera = root.Table("camera");
  scene.calibration.camera = ReadSceneCamera(camera);
  scene.calibration.mask = ReadMask(camera, scene.calibration.camera);
  scene.calibration.light = ReadLight(root.Table("light"));
  scene.calibration.response = ReadResponse(root.Table("response"));
  if (const auto path = root.Optional("path")) scene.path = ReadPath(*path);
  if (const auto lens = root.Optional("lens")) {
    if (const auto table = lens->Optional("defocus")) scene.defocus = ReadDefocus(*table);
    if (const auto table = lens->Optional("chromatic_aberration")) {
      scene.chromatic_aberration = ReadChromaticAberration(*table);
    }
  }
  if (const auto sensor = root.Optional("sensor")) scene.sensor = ReadSensor(*sensor);
  if (const auto truth = root.Optional("truth")) scene.truth = ReadTruth(*truth);
  if (const auto table = root.Optional("peristalsis")) scene.peristalsis = ReadPeristalsis(*table);
  const ConfigTable trajectory = root.Table("trajectory");
  scene.geometry =
      BuildGeometry(root.Table("geometry"), RandomBits(seed, kGeometrySeed), GivenPoses(trajectory));
  scene.surface = ReadSurface(root.Table("surface"), scene.geometry.mesh, RandomBits(seed, kVesselSeed));
  scene.world_from_camera = BuildTrajectory(trajectory, scene.geometry, RandomBits(seed, kTrajectorySeed));
  scene.path_is_stand_in = IsStandIn(trajectory);
  config.RejectUnknown();
  if (scene.path_is_stand_in) {
    Say(file.string() + ": " + trajectory.Path("path").string() +
        " is absent; a stand-in of the same length and motion takes its place");
  }
  CheckEndoscopeInLumen(scene, file);
  scene.effects = NameEffects(scene);
  return scene;
}

}  // namespace lumen
