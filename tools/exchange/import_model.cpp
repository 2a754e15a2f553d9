#include "tools/exchange/import_model.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <set>

#include "common/error.h"
#include "common/files.h"
#include "common/frame_lines.h"
#include "common/pose_file.h"
#include "common/progress.h"
#include "tools/exchange/colmap_model.h"
#include "tools/exchange/fisheye_fit.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

// The one camera that all images have, under one id or many.
CameraIntrinsics OnlyCamera(const ColmapModel& model, const fs::path& folder) {
  std::map<uint32_t, const ColmapCamera*> by_id;
  for (const ColmapCamera& camera : model.cameras) by_id[camera.id] = &camera;
  const ColmapCamera& first = *by_id.at(model.images[0].camera);
  for (const ColmapImage& image : model.images) {
    const ColmapCamera& camera = *by_id.at(image.camera);
    if (camera.model == first.model && camera.width == first.width && camera.height == first.height &&
        camera.parameters == first.parameters) {
      continue;
    }
    throw InputError(folder.string() + ": images " + model.images[0].name + " and " + image.name +
                     " have different cameras, but a sequence has one (COLMAP: ImageReader.single_camera)");
  }
  return FromColmap(first);
}

// The first number in each file name, where they are all different.
std::vector<int> Numbers(const std::vector<ColmapImage>& images) {
  std::vector<int> numbers;
  std::set<int> seen;
  for (const ColmapImage& image : images) {
    const std::string stem = fs::path(image.name).stem().string();
    const size_t digits = stem.find_first_of("0123456789");
    int number = 0;
    if (digits != std::string::npos &&
        std::from_chars(stem.data() + digits, stem.data() + stem.size(), number).ec == std::errc() &&
        seen.insert(number).second) {
      numbers.push_back(number);
    }
  }
  if (numbers.size() == images.size()) return numbers;
  numbers.clear();
  for (int i = 0; i < static_cast<int>(images.size()); ++i) numbers.push_back(i);
  return numbers;
}

// By number: images, and their numbers.
void SortByNumber(std::vector<ColmapImage>* images, std::vector<int>* numbers) {
  std::ranges::sort(*images, {}, &ColmapImage::name);
  *numbers = Numbers(*images);
  std::vector<size_t> order(images->size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::sort(order, {}, [&](size_t i) { return (*numbers)[i]; });
  std::vector<ColmapImage> sorted;
  for (size_t i : order) sorted.push_back(std::move((*images)[i]));
  *images = std::move(sorted);
  std::ranges::sort(*numbers);
}

// Whether `exported` is what an export writes in place of the calibration's camera; the fit, if so. Its
// numbers are written with every digit; other programs may keep a few fewer.
std::optional<FisheyeFit> FitBehind(const CameraIntrinsics& exported, const Calibration& calibration) {
  const CameraIntrinsics& own = calibration.camera;
  if (own.model != CameraModel::kScaramuzza || exported.model != CameraModel::kKannalaBrandt ||
      own.width != exported.width || own.height != exported.height) {
    return std::nullopt;
  }
  const FisheyeFit fit = FitFisheye(calibration);
  constexpr double kSame = 1e-6;  // px, and parts of a radius
  const auto same = [](double a, double b) { return std::abs(a - b) <= kSame; };
  const bool all = same(fit.camera.fx, exported.fx) && same(fit.camera.fy, exported.fy) &&
                   same(fit.camera.cx, exported.cx) && same(fit.camera.cy, exported.cy) &&
                   std::ranges::equal(fit.camera.k, exported.k, same);
  return all ? std::optional(fit) : std::nullopt;
}

// Light, response, mask and gains, from the calibration's sequence or C3VD's own; and its camera, where the
// model's stands for it: its images and the sequence's poses are turned back.
void Calibrate(const ImportOptions& options, std::vector<ColmapImage>* images, Sequence* sequence,
               ImportResult* result) {
  CameraIntrinsics camera = sequence->calibration.camera;
  if (options.calibration.empty()) {
    sequence->calibration = C3vdCalibration();
    sequence->calibration.mask = Image8();
  } else {
    const Sequence like = ReadSequence(options.calibration);
    if (const auto fit = FitBehind(camera, like.calibration)) {
      const Mat3d back = Eigen::AngleAxisd(-fit->roll_rad, Vec3d::UnitZ()).toRotationMatrix();
      for (ColmapImage& image : *images) image.camera_from_world.prerotate(back);
      for (SequenceFrame& frame : sequence->frames) frame.world_from_camera.rotate(back.transpose());
      camera = like.calibration.camera;
      result->turned_back_rad = fit->roll_rad;
    }
    sequence->calibration = like.calibration;
    Image8& mask = sequence->calibration.mask;
    if (mask.width != camera.width || mask.height != camera.height) mask = Image8();
    std::map<int, double> gains;
    for (const SequenceFrame& frame : like.frames) {
      if (frame.gain) gains[frame.number] = *frame.gain;
    }
    const bool all = std::ranges::all_of(
        sequence->frames, [&](const SequenceFrame& frame) { return gains.contains(frame.number); });
    if (all) {
      for (SequenceFrame& frame : sequence->frames) frame.gain = gains[frame.number];
    }
  }
  sequence->calibration.camera = camera;
}

SimilarityFit FitToPoses(const fs::path& file, const Sequence& sequence) {
  const std::vector<Pose> given = ReadPoses(file);
  std::vector<int> numbers;
  for (const SequenceFrame& frame : sequence.frames) numbers.push_back(frame.number);
  const auto lines = LinesOfFrames(numbers, given.size());
  if (!lines || given.size() < numbers.size()) {
    throw InputError(file.string() + ": " + std::to_string(given.size()) + " poses, but the model has " +
                     std::to_string(numbers.size()) + " images, up to number " +
                     std::to_string(numbers.back()));
  }
  std::vector<Pose> from, to;
  for (size_t i = 0; i < numbers.size(); ++i) {
    from.push_back(sequence.frames[i].world_from_camera);
    to.push_back(given[*(*lines)[i]]);
  }
  try {
    return FitSimilarity(from, to);
  } catch (const InputError& error) {
    throw InputError(file.string() + ": " + error.what());
  }
}

void SetScale(const ImportOptions& options, const ColmapModel& model, Sequence* sequence,
              ImportResult* result) {
  Similarity similarity{options.mm_per_unit, Mat3d::Identity(), Vec3d::Zero()};
  if (!options.scale_from.empty()) {
    result->from_poses = FitToPoses(options.scale_from, *sequence);
    similarity = result->from_poses->similarity;
  } else if (options.scale_from_light) {
    try {
      result->from_light = ScaleFromLight(*sequence, model.images, model.points, options.albedo);
    } catch (const DamagedFrame&) {
      throw;  // names its file itself
    } catch (const InputError& error) {
      throw InputError(options.model.string() + ": " + error.what());
    }
    similarity.scale = result->from_light->mm_per_unit;
  }
  result->mm_per_unit = similarity.scale;
  for (SequenceFrame& frame : sequence->frames) {
    frame.world_from_camera = Mapped(similarity, frame.world_from_camera);
  }
}

// Frames in the sequence's folder under its own names.
void BringImages(bool link, Sequence* sequence) {
  for (SequenceFrame& frame : sequence->frames) {
    const fs::path file = FrameFile(sequence->folder, frame.number, "color.png");
    if (frame.color.extension() != ".png") {
      WriteImage(file, ReadColor(*sequence, frame));
    } else if (link) {
      std::error_code error;
      fs::create_symlink(fs::absolute(frame.color), file, error);
      if (error) throw InputError(file.string() + ": cannot link: " + error.message());
    } else {
      WriteFile(file, ReadFile(frame.color));
    }
    frame.color = file;
  }
}

}  // namespace

ImportResult ImportModel(const ImportOptions& options, const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder, ignored) && !fs::is_empty(folder, ignored)) {
    throw InputError(folder.string() + ": is not empty; import into a folder of its own");
  }
  ColmapModel model = ReadColmapModel(options.model);
  std::vector<int> numbers;
  SortByNumber(&model.images, &numbers);
  Sequence sequence;
  sequence.folder = folder;
  sequence.has_toml = true;
  sequence.calibration.camera = OnlyCamera(model, options.model);
  for (size_t i = 0; i < numbers.size(); ++i) {
    SequenceFrame frame;
    frame.number = numbers[i];
    frame.color = options.images / model.images[i].name;
    if (!fs::is_regular_file(frame.color, ignored)) {
      throw InputError(frame.color.string() + ": the model has this image, but there is no such file");
    }
    frame.world_from_camera = model.images[i].camera_from_world.inverse();
    sequence.frames.push_back(frame);
  }
  ImportResult result;
  Calibrate(options, &model.images, &sequence, &result);
  result.frames = static_cast<int>(numbers.size());
  SetScale(options, model, &sequence, &result);
  CreateFolder(folder);
  BringImages(options.link, &sequence);
  WriteSequenceHeader(sequence);
  return result;
}

}  // namespace lumen
