#include "sim/render.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <regex>
#include <utility>

#include "common/error.h"
#include "common/files.h"
#include "common/parallel.h"
#include "common/progress.h"
#include "sim/face_visibility.h"
#include "sim/geometry/moving_wall.h"
#include "sim/ground_truth.h"
#include "sim/metering.h"
#include "sim/photographer.h"
#include "sim/surface_maps.h"

namespace lumen {
namespace {

class Renderer {
 public:
  Renderer(const Scene& scene, const RenderOptions& options)
      : scene_(scene),
        options_(options),
        walls_(scene.geometry, {scene.peristalsis, scene.surface.coat || Wants("shading_normal")}),
        rest_anchor_(Bounds(scene.geometry.mesh).center()),
        surface_seed_(SurfaceSeed(options.seed)),
        camera_(scene.calibration.camera),
        fast_camera_(scene.calibration.camera),
        valid_(ValidPixels(scene.calibration)),
        photographer_(scene, valid_, options.seed),
        seen_(scene.geometry.mesh.faces.size(), 0) {
    if (Wants("visibility")) visibility_.emplace(seen_.size());
    if (std::none_of(valid_.data.begin(), valid_.data.end(), [](uint8_t v) { return v != 0; })) {
      throw InputError("camera.mask: no pixel is left");
    }
    ChooseFrames();
  }

  RenderResult Run() {
    const auto start = std::chrono::steady_clock::now();
    Progress progress("render");
    CreateFolder(options_.folder);
    RemoveOldSequence();
    if (!scene_.truth.exact.empty()) CreateFolder(options_.folder / "exact");
    const std::vector<double> gains = Gains();
    for (const int frame : frames_) {
      RenderOne(frame, gains[frame]);
      progress.Update(double(++result_.frames) / static_cast<double>(frames_.size()));
    }
    writing_.Finish();
    WriteSequence(gains);
    result_.effects = scene_.effects;
    result_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return result_;
  }

 private:
  void ChooseFrames() {
    const int count = static_cast<int>(scene_.world_from_camera.size());
    const int last = options_.last_frame < 0 ? count : options_.last_frame;
    frames_ = options_.frames;
    if (frames_.empty()) {
      for (int frame = options_.first_frame; frame < last; ++frame) frames_.push_back(frame);
    }
    if (frames_.empty() || frames_.front() < 0 || frames_.back() >= count) {
      throw InputError("--frames " + std::to_string(options_.first_frame) + ":" + std::to_string(last) +
                       ": the scene has frames 0:" + std::to_string(count));
    }
  }

  bool Wants(const std::string& channel) const {
    return std::find(scene_.truth.exact.begin(), scene_.truth.exact.end(), channel) !=
           scene_.truth.exact.end();
  }

  bool WantsParts() const {
    return Wants("direct") || Wants("indirect") || Wants("glint") || Wants("subsurface");
  }

  PathScene PathSceneOf(const WallMoment& wall) const {
    PathScene path_scene{&wall.rays, &scene_.surface, surface_seed_, &wall.vertex_normals};
    if (walls_.moves()) {
      path_scene.rest = &scene_.geometry.mesh;
      path_scene.rest_anchor = rest_anchor_;
    }
    return path_scene;
  }

  std::vector<double> Gains() {
    const int count = static_cast<int>(scene_.world_from_camera.size());
    if (!scene_.sensor.auto_gain) {
      std::vector<double> gains(count, scene_.sensor.gain);
      for (int i = 0; scene_.sensor.gain_swing && i < count; ++i)
        gains[i] = GainAt(scene_.sensor.gain, *scene_.sensor.gain_swing, i);
      return gains;
    }
    const Meter meter(scene_, valid_, options_.seed);
    const auto metered = [&](int frame) {
      PathCount of_picture;
      const double brightness = meter.Brightness(PathSceneOf(*walls_.At(frame)), frame, &of_picture);
      NoteFailure(frame, " of the metering picture", of_picture.failure);
      return brightness;
    };
    std::vector<double> brightness = {metered(0)};
    // A stretch ends at the same frame whichever frames are asked for.
    while (static_cast<int>(brightness.size()) <= frames_.back()) {
      const int from = static_cast<int>(brightness.size()) - 1;
      const int to = std::min(from + scene_.sensor.auto_gain->metered_every, count - 1);
      const double at_from = brightness.back(), at_to = metered(to);
      for (int frame = from + 1; frame <= to; ++frame) {
        const double t = static_cast<double>(frame - from) / (to - from);
        brightness.push_back((1 - t) * at_from + t * at_to);
      }
    }
    return RunAutoGain(*scene_.sensor.auto_gain, scene_.calibration.response, brightness);
  }

  void RenderOne(int frame, double gain) {
    const std::shared_ptr<const WallMoment> wall = walls_.At(frame);
    View view = {&fast_camera_, &valid_, scene_.world_from_camera[frame], &scene_.calibration.light};
    if (scene_.defocus) view.defocus = &*scene_.defocus;
    std::optional<CameraMotion> motion;
    PathScene path_scene = PathSceneOf(*wall);
    std::unique_ptr<const WallMotion> wall_motion;
    if (scene_.sensor.shutter) {
      view.motion = &motion.emplace(*scene_.sensor.shutter, scene_.world_from_camera, frame);
      wall_motion = walls_.During(frame, scene_.sensor.shutter->Duration());
    }
    if (wall_motion) {
      path_scene.wall = &wall_motion->rays;
      path_scene.vertex_normals = wall_motion->vertex_normals.data();
    }
    Film film;
    const PathCount count =
        RenderFrame(path_scene, view, scene_.path, options_.seed, frame, WantsParts(), &film);
    // Without a coat there is no glint, without tissue nothing comes from below the surface.
    for (const auto& [part, image] : {std::pair("glint", &film.glint), {"subsurface", &film.subsurface}}) {
      if (Wants(part) && image->empty()) *image = ImageF(valid_.width, valid_.height, 3);
    }
    result_.samples += count.samples;
    result_.rays += count.rays;
    NoteFailure(frame, "", count.failure);
    Image8 picture = photographer_.Photograph(frame, gain, film.radiance);
    std::optional<FrameTruth> truth;
    if (scene_.truth.c3vd || !scene_.truth.exact.empty()) truth = TruthOf(frame, *wall);
    NoteSeen(frame, *wall);
    if (scene_.truth.exact.empty()) film = {};
    // Compressing keeps one thread busy; it can be done beside the next frame.
    writing_.Start(
        [this, frame, wall, picture = std::move(picture), film = std::move(film), truth = std::move(truth)] {
          WriteImage(FrameFile(options_.folder, frame, "color.png"), picture);
          if (scene_.truth.c3vd) WriteC3vd(frame, *truth);
          if (!scene_.truth.exact.empty()) WriteExact(frame, film, *truth);
          if (Wants("mesh"))
            WriteMesh(options_.folder / "exact" / ExactName(frame, "_mesh.ply"), wall->mesh());
        });
  }

  FrameTruth TruthOf(int frame, const WallMoment& wall) {
    const std::vector<Pose>& poses = scene_.world_from_camera;
    const Pose* previous = frame > 0 ? &poses[frame - 1] : nullptr;
    TruthExtras extras;
    const bool has_next = frame + 1 < static_cast<int>(poses.size());
    if (has_next && (Wants("flow_next") || Wants("seen_after"))) extras.world_from_next = &poses[frame + 1];
    if (Wants("shading_normal")) extras.vertex_normals = &wall.vertex_normals;
    std::shared_ptr<const WallMoment> before, after;
    if (walls_.moves()) {
      extras.rest = &scene_.geometry.mesh;
      if (previous) extras.wall_before = &(before = walls_.At(frame - 1))->rays;
      if (extras.world_from_next) extras.wall_after = &(after = walls_.At(frame + 1))->rays;
    }
    return ComputeTruth(wall.rays, camera_, valid_, poses[frame], previous, extras);
  }

  // The faces that the frames see. How often and how well is noted if it is asked for: it takes a look at
  // every face from every frame.
  void NoteSeen(int frame, const WallMoment& wall) {
    const Pose& pose = scene_.world_from_camera[frame];
    if (visibility_) std::fill(seen_.begin(), seen_.end(), uint8_t{0});
    MarkObserved(wall.rays, camera_, valid_, pose, &seen_);
    if (visibility_) AddFrame(wall.mesh(), pose.translation(), seen_, &*visibility_);
  }

  std::vector<bool> Observed() const {
    if (!visibility_) return std::vector<bool>(seen_.begin(), seen_.end());
    return std::vector<bool>(visibility_->frames.begin(), visibility_->frames.end());
  }

  void NoteFailure(int frame, const std::string& picture, const Failure& failure) {
    if (failure.count > 0 && result_.not_finite == 0) {
      result_.first_not_finite_frame = frame;
      result_.first_not_finite = "frame " + std::to_string(frame) + ", pixel (" + std::to_string(failure.x) +
                                 ", " + std::to_string(failure.y) + ")" + picture + ", sample " +
                                 std::to_string(failure.sample);
    }
    result_.not_finite += failure.count;
  }

  void WriteC3vd(int frame, const FrameTruth& truth) const {
    WriteImage(FrameFile(options_.folder, frame, "depth.tiff"), EncodeDepth(truth.z));
    WriteImage(FrameFile(options_.folder, frame, "normals.tiff"), EncodeNormals(truth.normal));
    WriteImage(FrameFile(options_.folder, frame, "occlusion.png"), truth.occlusion);
    if (!truth.flow.empty())
      WriteImage(FrameFile(options_.folder, frame, "flow.tiff"), EncodeFlow(truth.flow));
  }

  void WriteExact(int frame, const Film& film, const FrameTruth& truth) const {
    std::vector<std::string> names;
    std::vector<ImageF> images;
    auto add = [&](const std::string& name, const ImageF& image, const std::vector<std::string>& parts) {
      if (!Wants(name) || image.empty()) return;
      for (const std::string& part : parts) names.push_back(part.empty() ? name : name + "." + part);
      images.push_back(image);
    };
    const std::vector<std::string> rgb = {"R", "G", "B"}, xyz = {"X", "Y", "Z"}, one = {""};
    add("radiance", film.radiance, rgb);
    add("direct", film.direct, rgb);
    add("indirect", film.indirect, rgb);
    add("glint", film.glint, rgb);
    add("subsurface", film.subsurface, rgb);
    if (Wants("albedo")) add("albedo", AlbedoMap(scene_.surface, surface_seed_, rest_anchor_, truth), rgb);
    add("z", truth.z, one);
    add("distance", truth.distance, one);
    add("normal", truth.normal, xyz);
    if (Wants("shading_normal")) {
      const Pose& pose = scene_.world_from_camera[frame];
      add("shading_normal", ShadingNormalMap(scene_.surface, surface_seed_, rest_anchor_, pose, truth), xyz);
    }
    add("position", truth.position, xyz);
    add("flow", truth.flow, {"X", "Y"});
    add("seen_before", truth.seen_before, one);
    add("flow_next", truth.flow_next, {"X", "Y"});
    add("seen_after", truth.seen_after, one);
    ImageF all(truth.z.width, truth.z.height, static_cast<int>(names.size()));
    int channel = 0;
    for (const ImageF& image : images) {
      for (size_t pixel = 0; pixel < size_t(all.width) * all.height; ++pixel) {
        std::copy_n(&image.data[pixel * image.channels], image.channels,
                    &all.data[pixel * all.channels + channel]);
      }
      channel += image.channels;
    }
    if (all.channels > 0) WriteExr(options_.folder / "exact" / ExactName(frame, ".exr"), all, names);
  }

  static std::string ExactName(int frame, const std::string& ending) {
    char number[16];
    std::snprintf(number, sizeof(number), "%04d", frame);
    return number + ending;
  }

  void WriteSequence(const std::vector<double>& gains) const {
    const Mesh& mesh = scene_.geometry.mesh;
    Sequence sequence;
    sequence.folder = options_.folder;
    sequence.has_toml = true;
    sequence.calibration = scene_.calibration;
    for (const int frame : frames_) {
      SequenceFrame entry;
      entry.number = frame;
      entry.world_from_camera = scene_.world_from_camera[frame];
      if (scene_.sensor.record_gain) entry.gain = gains[frame];
      sequence.frames.push_back(entry);
    }
    WriteCoverageMesh(options_.folder / "coverage_mesh.obj", mesh, Observed());
    if (visibility_) WriteFaceVisibility(options_.folder / "exact" / "visibility.ply", mesh, *visibility_);
    sequence.ground_truth_mesh = options_.folder / "mesh.ply";
    WriteMesh(sequence.ground_truth_mesh, mesh);
    WriteSequenceHeader(sequence);
  }

  // Whatever an earlier render left would be taken for this one's: frames that this one doesn't have, truth
  // that it isn't asked for, a calibration estimated from other pictures. The header goes first and comes
  // back last, so that a folder whose render was interrupted is no sequence.
  void RemoveOldSequence() const {
    const auto& folder = options_.folder;
    if (std::filesystem::exists(folder / "pose.txt") && !std::filesystem::exists(folder / "sequence.toml")) {
      throw InputError(folder.string() +
                       ": holds a sequence that wasn't rendered (pose.txt without sequence.toml); " +
                       "choose another folder");
    }
    for (const char* name :
         {"pose.txt", "sequence.toml", "calibration.toml", "mask.png", "exact/visibility.ply"}) {
      std::filesystem::remove(folder / name);
    }
    static const std::regex kFrameFile(
        R"(\d{4,}(_(color|occlusion)\.png|_(depth|normals|flow)\.tiff|_mesh\.ply|\.exr))");
    for (const auto& place : {folder, folder / "exact"}) {
      if (!std::filesystem::is_directory(place)) continue;
      std::vector<std::filesystem::path> old;
      for (const auto& entry : std::filesystem::directory_iterator(place)) {
        if (std::regex_match(entry.path().filename().string(), kFrameFile)) old.push_back(entry.path());
      }
      for (const auto& path : old) std::filesystem::remove(path);
    }
  }

  const Scene& scene_;
  RenderOptions options_;
  MovingWall walls_;
  Vec3d rest_anchor_;
  uint64_t surface_seed_;
  Camera<double> camera_;
  Camera<float> fast_camera_;
  Image8 valid_;
  Photographer photographer_;
  std::vector<uint8_t> seen_;  // of the faces: by any frame so far, with visibility by the last
  std::optional<FaceVisibility> visibility_;  // if it is asked for
  std::vector<int> frames_;                   // to render, ascending
  RenderResult result_;
  BackgroundWork writing_;  // of the frame before; last, for it refers to what is above
};

}  // namespace

RenderResult Render(const Scene& scene, const RenderOptions& options) {
  return Renderer(scene, options).Run();
}

}  // namespace lumen
