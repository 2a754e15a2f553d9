#include "recon/evaluation/sheet.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "common/files.h"
#include "common/progress.h"
#include "common/ray_scene.h"
#include "recon/evaluation/colormap.h"
#include "recon/evaluation/layout.h"
#include "recon/evaluation/portrait.h"
#include "recon/evaluation/visibility.h"
#include "recon/evaluation/walk.h"

namespace lumen {
namespace {

constexpr double kSaturation_mm = 10;  // the paper's: fully red or blue from 1 cm on
constexpr Rgb8 kTissue = {225, 190, 175};
constexpr Rgb8 kBlack = {0, 0, 0};

// Everything that several pictures show.
struct Subjects {
  const Sequence& sequence;
  Portrait truth, reconstruction;
  std::vector<Rgb8> truth_plain, truth_views, reconstruction_plain, reconstruction_error;
};

// The frame's own camera with a picture of the given height.
View WithinView(const Sequence& sequence, int frame, int height) {
  const Calibration& calibration = sequence.calibration;
  const int width =
      static_cast<int>(std::lround(double(height) * calibration.camera.width / calibration.camera.height));
  View view;
  view.camera = Resized(calibration.camera, width, height);
  view.world_from_camera = sequence.frames[frame].world_from_camera;
  view.background = kBlack;
  if (!calibration.mask.empty()) view.valid = Scaled(calibration.mask, width, height);
  return view;
}

// From where both meshes are looked at from outside: all that the frames see of the truth is in the picture.
View CommonOutsideView(const Mesh& truth, const std::vector<int>& frames_seeing, int width, int height) {
  std::vector<Vec3d> seen;
  for (size_t v = 0; v < truth.vertices.size(); ++v) {
    if (frames_seeing[v] > 0) seen.push_back(truth.vertices[v]);
  }
  return OutsideView(seen.empty() ? truth.vertices : seen, width, height);
}

ColorBar ErrorBar() {
  return {[](double t) { return Seismic(2 * t - 1); }, "-1 cm (inside)", "0", "+1 cm (outside)"};
}

ColorBar ViewsBar(const Sequence& sequence) {
  return {Jet, "1", "frames that see it (grey: none)", std::to_string(sequence.frames.size())};
}

struct NamedFrame {
  std::string name;
  int frame;
};

// First, middle and deepest frame of a sequence: the deepest is the one whose camera is furthest along the
// direction in which the cameras look on the whole. A withdrawal starts there; then the last one stands for
// it.
std::vector<NamedFrame> KeyFrames(const Sequence& sequence) {
  Vec3d forward = Vec3d::Zero();
  for (const SequenceFrame& frame : sequence.frames) forward += frame.world_from_camera.linear().col(2);
  const auto depth = [&](const SequenceFrame& frame) {
    return frame.world_from_camera.translation().dot(forward);
  };
  const auto deepest =
      std::max_element(sequence.frames.begin(), sequence.frames.end(),
                       [&](const SequenceFrame& a, const SequenceFrame& b) { return depth(a) < depth(b); });
  const int count = static_cast<int>(sequence.frames.size());
  const int deepest_frame = static_cast<int>(deepest - sequence.frames.begin());
  std::vector<NamedFrame> frames = {{"first", 0}, {"middle", count / 2}, {"deepest", deepest_frame}};
  for (int other : {0, 1}) {
    if (deepest_frame != frames[other].frame) continue;
    frames[other].name += ", deepest";
    frames[2] = {"last", count - 1};
  }
  return frames;
}

Image8 InputPanel(const Sequence& sequence, int frame, int width, int height) {
  const SequenceFrame& source = sequence.frames[frame];
  if (!source.color.empty()) return Scaled(ReadColor(sequence, source), width, height);
  Image8 panel(width, height, 3);
  DrawText(&panel, width / 2, height / 2, 16, "no colour file", {255, 255, 255}, TextAlign::kCentre);
  return panel;
}

Image8 Sheet(const Subjects& subjects, const View& outside, int height) {
  const Sequence& sequence = subjects.sequence;
  std::vector<Panel> panels;
  for (const auto& [name, frame] : KeyFrames(sequence)) {
    const View view = WithinView(sequence, frame, height);
    const std::string number = std::to_string(sequence.frames[frame].number);
    panels.push_back({"input: frame " + number + " (" + name + ")",
                      InputPanel(sequence, frame, view.camera.width, height)});
    panels.push_back({"truth", subjects.truth.Draw(view, subjects.truth_plain)});
    panels.push_back({"reconstruction", subjects.reconstruction.Draw(view, subjects.reconstruction_plain)});
    panels.push_back({"error", subjects.reconstruction.Draw(view, subjects.reconstruction_error)});
  }
  panels.push_back({"truth from outside", subjects.truth.Draw(outside, subjects.truth_plain)});
  panels.push_back({"surveyed", subjects.truth.Draw(outside, subjects.truth_views)});
  panels.push_back({"reconstruction", subjects.reconstruction.Draw(outside, subjects.reconstruction_plain)});
  panels.push_back({"error", subjects.reconstruction.Draw(outside, subjects.reconstruction_error)});
  return Compose(panels, 4, {ViewsBar(sequence), ErrorBar()});
}

void WriteColored(const std::filesystem::path& file, const Mesh& mesh, const std::vector<Rgb8>& colors) {
  Mesh colored = mesh;
  colored.colors = colors;
  WriteMesh(file, colored);
}

}  // namespace

void WriteEvaluationPictures(const Evaluation& evaluation, const Mesh& reconstruction, const Mesh& truth,
                             const Sequence& sequence, const std::filesystem::path& folder) {
  Progress progress("pictures");
  CreateFolder(folder);
  const std::vector<int> truth_seen = SeeVertices(RayScene(truth), FrameViews(sequence)).frames_seeing;
  const Subjects subjects = {
      .sequence = sequence,
      .truth = Portrait(truth),
      .reconstruction = Portrait(reconstruction),
      .truth_plain = std::vector<Rgb8>(truth.vertices.size(), kTissue),
      .truth_views = CountColors(truth_seen, static_cast<int>(sequence.frames.size())),
      .reconstruction_plain = std::vector<Rgb8>(reconstruction.vertices.size(), kTissue),
      .reconstruction_error = ErrorColors(evaluation.signed_error_mm, kSaturation_mm),
  };
  WriteColored(folder / "error.ply", reconstruction, subjects.reconstruction_error);
  WriteColored(folder / "views.ply", truth, subjects.truth_views);

  constexpr int kHeight = 480, kSheetHeight = 320;
  const View outside = CommonOutsideView(truth, truth_seen, kHeight * 4 / 3, kHeight);
  const View within = WithinView(sequence, evaluation.best_frame, kHeight);
  const std::string from_within =
      "from within (frame " + std::to_string(sequence.frames[evaluation.best_frame].number) + ")";
  progress.Update(0.2);
  WriteImage(folder / "error.png",
             Compose({{"from outside", subjects.reconstruction.Draw(outside, subjects.reconstruction_error)},
                      {from_within, subjects.reconstruction.Draw(within, subjects.reconstruction_error)}},
                     2, {ErrorBar()}));
  WriteImage(folder / "views.png",
             Compose({{"from outside", subjects.truth.Draw(outside, subjects.truth_views)},
                      {from_within, subjects.truth.Draw(within, subjects.truth_views)}},
                     2, {ViewsBar(sequence)}));
  progress.Update(0.5);
  const int sheet_width = WithinView(sequence, 0, kSheetHeight).camera.width;
  WriteImage(folder / "sheet.png",
             Sheet(subjects, CommonOutsideView(truth, truth_seen, sheet_width, kSheetHeight), kSheetHeight));
  progress.Update(0.8);
  WriteWalk(reconstruction, evaluation.frames_seeing, sequence, folder);
}

}  // namespace lumen
