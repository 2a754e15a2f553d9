#include "common/pose_file.h"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <optional>

#include "common/error.h"
#include "common/files.h"
#include "common/line_reader.h"

namespace lumen {
namespace {

using Row = std::array<double, 16>;

// What files of a few digits may be off, and what doubles may.
constexpr double kRotationTolerance = 1e-3;
constexpr double kRoundingTolerance = 1e-13;

Row ParseRow(LineReader* reader) {
  // Commas and blanks separate alike.
  std::string line(reader->rest());
  std::replace(line.begin(), line.end(), ',', ' ');
  LineReader numbers("", line);
  numbers.NextLine();
  Row row;
  size_t count = 0;
  for (std::string_view word = numbers.Word(); !word.empty(); word = numbers.Word(), ++count) {
    if (count < row.size()) row[count] = reader->ToNumber(word, "number " + std::to_string(count));
  }
  if (count != row.size()) {
    reader->Fail("a pose is 16 numbers, camera to world, but here are " + std::to_string(count));
  }
  return row;
}

bool AllZero(const Row& row, int a, int b, int c) { return row[a] == 0 && row[b] == 0 && row[c] == 0; }

Pose ToPose(const LineReader& reader, const Row& row, bool transposed) {
  Pose pose = Pose::Identity();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) pose.matrix()(r, c) = row[transposed ? 4 * c + r : 4 * r + c];
  }
  const Mat3d rotation = pose.linear();
  const double error = (rotation.transpose() * rotation - Mat3d::Identity()).cwiseAbs().maxCoeff();
  // Written so that NaN fails.
  if (!(error < kRotationTolerance) || rotation.determinant() < 0) {
    std::string how_far;
    AppendNumber(&how_far, error);
    reader.Fail(rotation.determinant() < 0
                    ? "a pose mirrors: its 3×3 part must be a rotation"
                    : "a pose's 3×3 part is no rotation: off orthonormal by " + how_far);
  }
  if (error > kRoundingTolerance) {
    const Eigen::JacobiSVD<Mat3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
    pose.linear() = svd.matrixU() * svd.matrixV().transpose();
  }
  return pose;
}

}  // namespace

std::vector<PoseLine> ReadPoseLines(const std::filesystem::path& file) {
  const std::string text = ReadFile(file);
  LineReader reader(file, text);
  struct Parsed {
    std::optional<Row> row;
    LineReader place;
  };
  std::vector<Parsed> parsed;
  std::vector<PoseLine> lines;
  std::optional<bool> transposed;  // known from the first pose that isn't both
  while (reader.NextFilledLine()) {
    parsed.push_back({std::nullopt, reader});
    PoseLine& line = lines.emplace_back();
    try {
      const Row row = ParseRow(&reader);
      if (row[15] != 1) reader.Fail("a pose's last number must be 1");
      const bool fits_today = AllZero(row, 3, 7, 11), fits_first = AllZero(row, 12, 13, 14);
      if (!fits_today && !fits_first) {
        reader.Fail("a pose with both numbers 3, 7, 11 and 12–14 other than 0");
      }
      if (fits_today != fits_first) {
        if (transposed.value_or(fits_today) != fits_today) {
          reader.Fail("a pose is laid out otherwise (transposed) than those before");
        }
        transposed = fits_today;
      }
      parsed.back().row = row;
    } catch (const InputError& error) {
      line.problem = error.what();
    }
  }
  for (size_t i = 0; i < lines.size(); ++i) {
    if (!parsed[i].row) continue;
    try {
      lines[i].pose = ToPose(parsed[i].place, *parsed[i].row, transposed.value_or(true));
    } catch (const InputError& error) {
      lines[i].problem = error.what();
    }
  }
  return lines;
}

std::vector<Pose> ReadPoses(const std::filesystem::path& file) {
  std::vector<Pose> poses;
  for (const PoseLine& line : ReadPoseLines(file)) {
    if (!line.pose) throw InputError(line.problem);
    poses.push_back(*line.pose);
  }
  return poses;
}

std::string PosesText(const std::vector<Pose>& world_from_camera) {
  std::string text;
  for (const Pose& pose : world_from_camera) {
    for (int i = 0; i < 16; ++i) {
      if (i > 0) text += ',';
      AppendNumber(&text, pose.matrix()(i % 4, i / 4));
    }
    text += '\n';
  }
  return text;
}

}  // namespace lumen
