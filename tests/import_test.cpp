// COLMAP models, text and binary, and the millimetres that they lack.
#include <sys/wait.h>

#include <Eigen/Geometry>
#include <cstdlib>

#include "common/files.h"
#include "common/pose_file.h"
#include "common/progress.h"
#include "common/random.h"
#include "common/ray_scene.h"
#include "recon/evaluation/visibility.h"
#include "tests/small_sequence.h"
#include "tests/support.h"
#include "tools/exchange/import_model.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;
using test::ErrorOf;
using test::ScratchFolder;

// Written by hand after COLMAP's documentation; one image with a blank in its name, one without points.
constexpr char kCameras[] =
    "# Camera list\n# Number of cameras: 1\n7 OPENCV_FISHEYE 20 10 8.5 8.25 10.5 5.5 -0.125 0.5 0.25 "
    "-0.0625\n";
constexpr char kImages[] =
    "# Image list\n"
    "4 0.5 0.5 0.5 0.5 1 2 3 7 run 1/frame_12.png\n"
    "2.5 3.5 9 4.25 5.5 -1 6.5 7.5 11\n"
    "2 2 0 0 0 0 0 -8 7 run 1/frame_2.png\n"
    "\n";
constexpr char kPoints[] = "# 3D points\n9 1 2 3 255 0 128 0.5 4 0\n11 -1.5 0.25 1e3 1 2 3 0.125 4 2\n";

// The same in COLMAP's binary layout.
constexpr char kPython[] = R"(
import struct, sys
folder = sys.argv[1]
with open(folder + '/cameras.bin', 'wb') as f:
    f.write(struct.pack('<QIiQQ8d', 1, 7, 5, 20, 10, 8.5, 8.25, 10.5, 5.5, -0.125, 0.5, 0.25, -0.0625))
with open(folder + '/images.bin', 'wb') as f:
    f.write(struct.pack('<QI7dI', 2, 4, .5, .5, .5, .5, 1, 2, 3, 7) + b'run 1/frame_12.png\0')
    f.write(struct.pack('<Q', 3))
    for x, y, point in (2.5, 3.5, 9), (4.25, 5.5, 2**64 - 1), (6.5, 7.5, 11):
        f.write(struct.pack('<ddQ', x, y, point))
    f.write(struct.pack('<I7dI', 2, 2, 0, 0, 0, 0, 0, -8, 7) + b'run 1/frame_2.png\0' + struct.pack('<Q', 0))
with open(folder + '/points3D.bin', 'wb') as f:
    f.write(struct.pack('<Q', 2))
    f.write(struct.pack('<Q3d3BdQII', 9, 1, 2, 3, 255, 0, 128, .5, 1, 4, 0))
    f.write(struct.pack('<Q3d3BdQII', 11, -1.5, .25, 1e3, 1, 2, 3, .125, 1, 4, 2))
)";

class ColmapModelFiles : public testing::Test {
 protected:
  ColmapModelFiles() { SetQuiet(true); }
  void WriteText() {
    CreateFolder(folder());
    WriteFile(folder() / "cameras.txt", kCameras);
    WriteFile(folder() / "images.txt", kImages);
    WriteFile(folder() / "points3D.txt", kPoints);
  }
  void WriteBinary() {
    CreateFolder(folder());
    WriteFile(scratch_ / "writer.py", kPython);
    const std::string command =
        "/usr/bin/python3 '" + (scratch_ / "writer.py").string() + "' '" + folder().string() + "'";
    ASSERT_EQ(std::system(command.c_str()), 0);
  }
  void ExpectTheModel() {
    const ColmapModel model = ReadColmapModel(folder());
    const CameraIntrinsics camera = FromColmap(model.cameras.at(0));
    EXPECT_EQ(camera.model, CameraModel::kKannalaBrandt);
    EXPECT_EQ(camera.width, 20);
    EXPECT_EQ(camera.fy, 8.25);
    EXPECT_EQ(camera.cx, 10);  // COLMAP's pixels have their centres at halves
    EXPECT_EQ(camera.k, (std::array<double, 4>{-0.125, 0.5, 0.25, -0.0625}));
    ASSERT_EQ(model.images.size(), 2u);
    const ColmapImage& image = model.images[0];
    EXPECT_EQ(image.name, "run 1/frame_12.png");
    // A third of a turn about (1, 1, 1): x goes to y, y to z.
    EXPECT_TRUE(
        image.camera_from_world.linear().isApprox((Mat3d() << 0, 0, 1, 1, 0, 0, 0, 1, 0).finished(), 1e-15));
    EXPECT_EQ(image.camera_from_world.translation(), Vec3d(1, 2, 3));
    ASSERT_EQ(image.observations.size(), 2u);
    EXPECT_EQ(image.observations[1].pixel, Vec2d(6, 7));
    EXPECT_EQ(image.observations[1].point, 11u);
    EXPECT_EQ(model.images[1].camera_from_world.matrix().topLeftCorner(3, 3), Mat3d::Identity());
    EXPECT_TRUE(model.images[1].observations.empty());
    ASSERT_EQ(model.points.size(), 2u);
    EXPECT_EQ(model.points.at(11).position, Vec3d(-1.5, 0.25, 1e3));
    EXPECT_EQ(model.points.at(9).color, (Rgb8{255, 0, 128}));
    EXPECT_EQ(model.points.at(9).error_px, 0.5);
  }
  // The error of reading, from the model's folder on.
  std::string Error() const {
    const std::string error = ErrorOf([&] {
      for (const ColmapCamera& camera : ReadColmapModel(folder()).cameras) FromColmap(camera);
    });
    const size_t start = folder().string().size() + 1;
    return error.size() > start ? error.substr(start) : error;
  }
  void Damage(const std::string& name, const std::string& from, const std::string& to) {
    std::string text = ReadFile(folder() / name);
    ASSERT_NE(text.find(from), std::string::npos);
    WriteFile(folder() / name, text.replace(text.find(from), from.size(), to));
  }
  fs::path folder() const { return scratch_ / "model"; }

  ScratchFolder scratch_;
};

TEST_F(ColmapModelFiles, TextIsRead) {
  WriteText();
  ExpectTheModel();
}

TEST_F(ColmapModelFiles, BinaryIsRead) {
  WriteBinary();
  ExpectTheModel();
}

TEST_F(ColmapModelFiles, MistakesInTextHaveTheirLine) {
  const std::tuple<std::string, std::string, std::string, std::string> kCases[] = {
      {"cameras.txt", "OPENCV_FISHEYE", "OPENCV_FISHY",
       "cameras.txt:3: \"OPENCV_FISHY\" is no camera model of COLMAP"},
      {"cameras.txt", " -0.0625", "", "cameras.txt:3: the line ends where parameter 7 should be"},
      {"cameras.txt", " -0.0625", " -0.0625 1", "cameras.txt:3: OPENCV_FISHEYE has 8 parameters"},
      {"cameras.txt", " 20 ", " 0 ", "cameras.txt:3: the width is no size"},
      {"cameras.txt", "OPENCV_FISHEYE", "OPENCV",
       "cameras.txt:3: a camera of model OPENCV has no counterpart here; use OPENCV_FISHEYE, or let COLMAP "
       "undistort the images"},
      {"cameras.txt", " 8.5 ", " -8.5 ",
       "cameras.txt:3: camera: fx and fy must be positive, not -8.500000 and 8.250000"},
      {"images.txt", "0.5 0.5 0.5 0.5", "0 0 0 0", "images.txt:2: the quaternion is no rotation"},
      {"images.txt", "0.5 0.5 0.5 0.5", "0.5 nan 0.5 0.5",
       "images.txt:2: the quaternion is \"nan\", but must be finite"},
      {"images.txt", " 7 run 1/frame_12.png", "",
       "images.txt:2: the line ends where the camera's id should be"},
      {"images.txt", " run 1/frame_12.png", "",
       "images.txt:2: the line ends where the image's name should be"},
      {"images.txt", " 7 run 1/frame_12.png", " 8 run 1/frame_12.png",
       "images.txt: image run 1/frame_12.png is of camera 8, which isn't in the model"},
      {"images.txt", "7.5 11", "7.5", "images.txt:3: the line ends where the point's id should be"},
      {"images.txt", "7.5 11", "7.5 12",
       "images.txt: image run 1/frame_12.png sees point 12, which isn't in the model"},
      {"points3D.txt", "-1.5 0.25", "-1.5 x", "points3D.txt:3: the position is \"x\", which is no number"}};
  for (const auto& [name, from, to, error] : kCases) {
    WriteText();
    Damage(name, from, to);
    EXPECT_EQ(Error(), error);
  }
  WriteText();
  WriteFile(folder() / "images.txt", "# none\n");
  EXPECT_EQ(Error(), "images.txt: no image");
  fs::remove(folder() / "images.txt");
  EXPECT_EQ(Error(), "images.txt: cannot read: No such file or directory");
  fs::remove(folder() / "cameras.txt");
  EXPECT_NE(ErrorOf([&] { ReadColmapModel(folder()); }).find("no COLMAP model"), std::string::npos);
}

// Cut short anywhere a binary file is an error that names file and element, never a crash.
TEST_F(ColmapModelFiles, BinaryFilesCutShortAreErrors) {
  for (const std::string name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    WriteBinary();
    const std::string whole = ReadFile(folder() / name);
    for (size_t size = 0; size < whole.size(); ++size) {
      WriteFile(folder() / name, whole.substr(0, size));
      EXPECT_TRUE(Error().starts_with(name + ": ")) << name << " " << size << ": " << Error();
    }
    WriteFile(folder() / name, whole + "x");
    EXPECT_NE(Error().find("bytes behind the last element"), std::string::npos) << Error();
    // A count beyond all bounds asks for no memory.
    WriteFile(folder() / name, std::string(8, '\xff') + whole.substr(8));
    EXPECT_TRUE(Error().starts_with(name + ": ")) << Error();
  }
  WriteBinary();
  std::string cameras = ReadFile(folder() / "cameras.bin");
  cameras[12] = 99;
  WriteFile(folder() / "cameras.bin", cameras);
  EXPECT_EQ(Error(), "cameras.bin: camera 0, byte 16: 99 is no camera model of COLMAP");
}

TEST_F(ColmapModelFiles, OtherFisheyesAndPinholesHaveACounterpart) {
  const auto of = [](const std::string& model, const std::vector<double>& parameters) {
    ColmapCamera camera;
    camera.model = model;
    camera.width = camera.height = 9;
    camera.parameters = parameters;
    return FromColmap(camera);
  };
  EXPECT_EQ(of("SIMPLE_PINHOLE", {5, 4, 3}).fy, 5);
  EXPECT_EQ(of("SIMPLE_PINHOLE", {5, 4, 3}).cy, 2.5);
  EXPECT_EQ(of("PINHOLE", {5, 6, 4, 3}).fy, 6);
  EXPECT_EQ(of("RADIAL_FISHEYE", {5, 4, 3, .1, .2}).k, (std::array<double, 4>{.1, .2, 0, 0}));
  EXPECT_EQ(of("SIMPLE_RADIAL_FISHEYE", {5, 4, 3, .1}).k[0], .1);
  EXPECT_EQ(of("OPENCV", {5, 6, 4, 3, 0, 0, 0, 0}).model, CameraModel::kPinhole);
  EXPECT_NE(ErrorOf([&] { of("SIMPLE_RADIAL", {5, 4, 3, .1}); }), "");
  EXPECT_NE(ErrorOf([&] { of("THIN_PRISM_FISHEYE", {5, 6, 4, 3, .1, 0, 0, 0, 0, 0, 0, 0}); }), "");
}

Vec3d RandomVector(uint64_t index) {
  Vec3d v;
  for (int axis = 0; axis < 3; ++axis) v[axis] = 2 * UniformDouble(RandomBits(5, index, axis)) - 1;
  return v;
}

// Poses all over the place, and what a similarity makes of them.
struct PosePairs {
  std::vector<Pose> from, to;
  Similarity similarity{2.5, Eigen::AngleAxisd(0.8, Vec3d(1, -2, 3).normalized()).toRotationMatrix(),
                        Vec3d(100, -50, 7)};
  PosePairs() {
    for (int i = 0; i < 12; ++i) {
      Pose pose = Pose::Identity();
      pose.translation() = 30 * RandomVector(i);
      pose.linear() = Eigen::AngleAxisd(3 * RandomVector(100 + i).x(), RandomVector(200 + i).normalized())
                          .toRotationMatrix();
      from.push_back(pose);
      to.push_back(Mapped(similarity, pose));
    }
  }
};

TEST(Similarity, IsFoundAndAgreesWithUmeyama) {
  const PosePairs pairs;
  const SimilarityFit fit = FitSimilarity(pairs.from, pairs.to);
  EXPECT_NEAR(fit.similarity.scale, 2.5, 1e-13);
  EXPECT_LT(fit.max_mm, 1e-12);
  Eigen::Matrix3Xd from(3, 12), to(3, 12);
  for (int i = 0; i < 12; ++i) {
    from.col(i) = pairs.from[i].translation();
    to.col(i) = pairs.to[i].translation();
  }
  const Eigen::Matrix4d theirs = Eigen::umeyama(from, to);
  EXPECT_TRUE((fit.similarity.scale * fit.similarity.rotation).isApprox(theirs.topLeftCorner<3, 3>(), 1e-12));
  EXPECT_TRUE(fit.similarity.translation.isApprox(theirs.topRightCorner<3, 1>(), 1e-11));
}

TEST(Similarity, SaysWhatIsLeft) {
  PosePairs pairs;
  pairs.to[3].translation() += Vec3d(0, 12, 0);
  pairs.to[5].rotate(Eigen::AngleAxisd(0.12, Vec3d::UnitX()));
  const SimilarityFit fit = FitSimilarity(pairs.from, pairs.to);
  // One of twelve is off: what the mean takes of it is left of eleven.
  EXPECT_NEAR(fit.max_mm, 11, 0.6);
  EXPECT_NEAR(fit.max_rad, 0.11, 0.003);
  EXPECT_NEAR(fit.rms_mm, 12 * std::sqrt(11.0) / 12, 0.3);
}

// Along a line the centres don't tell the rotation about it; the cameras do.
TEST(Similarity, KnowsTheTurnAboutAStraightPath) {
  PosePairs pairs;
  for (size_t i = 0; i < pairs.from.size(); ++i) {
    pairs.from[i].translation() = Vec3d(0, 0, 3.0 * static_cast<double>(i));
    pairs.to[i] = Mapped(pairs.similarity, pairs.from[i]);
  }
  const SimilarityFit fit = FitSimilarity(pairs.from, pairs.to);
  EXPECT_TRUE(fit.similarity.rotation.isApprox(pairs.similarity.rotation, 1e-12));
  for (Pose& pose : pairs.from) pose.translation().setZero();
  EXPECT_NE(ErrorOf([&] { FitSimilarity(pairs.from, pairs.to); }), "");
}

// A wall at z = 20 mm of albedo 0.4, seen by two cameras under a spotlight at the camera; everything by the
// formula. The model's unit is 4 mm.
class ScaleFromLightTest : public testing::Test {
 protected:
  static constexpr double kUnit_mm = 4, kWall_mm = 20, kAlbedo = 0.4, kIntensity = 2000, kSpread = 1.5;
  static constexpr int kSide = 64;

  ScaleFromLightTest() {
    SetQuiet(true);
    sequence_.folder = scratch_ / "like";
    CreateFolder(sequence_.folder);
    CameraIntrinsics& camera = sequence_.calibration.camera;
    camera.width = camera.height = kSide;
    camera.cx = camera.cy = (kSide - 1) / 2.0;
    camera.fx = camera.fy = 40;
    LightSource source;
    source.spread = kSpread;
    source.intensity = Vec3d(1, kIntensity, 1);
    sequence_.calibration.light.sources = {source};
    std::string images, points;
    int point = 0;
    CreateFolder(scratch_ / "model");
    for (int i = 0; i < 2; ++i) {
      SequenceFrame frame;
      frame.number = i;
      frame.gain = 0.8 + 0.1 * i;
      frame.world_from_camera.translation() = Vec3d(3.0 * i, 0, 2.0 * i);
      frame.color = FrameFile(sequence_.folder, i, "color.png");
      WriteImage(frame.color, Paint(frame, &points, &images, &point));
      sequence_.frames.push_back(frame);
    }
    WriteSequenceHeader(sequence_);
    WriteFile(scratch_ / "model/cameras.txt", "1 PINHOLE 64 64 40 40 32 32\n");
    WriteFile(scratch_ / "model/images.txt", images);
    WriteFile(scratch_ / "model/points3D.txt", points);
  }

  // A frame's picture, and every 8th of its pixels as a point of the model.
  Image8 Paint(const SequenceFrame& frame, std::string* points, std::string* images, int* point) {
    const Vec3d centre = frame.world_from_camera.translation();
    *images += std::to_string(frame.number + 1) + " 1 0 0 0 ";
    for (int axis = 0; axis < 3; ++axis) *images += std::to_string(-centre[axis] / kUnit_mm) + " ";
    *images += "1 000" + std::to_string(frame.number) + "_color.png\n";
    Image8 color(kSide, kSide, 3);
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const Vec3d ray = Vec3d((x - 31.5) / 40, (y - 31.5) / 40, 1).normalized();
        const double cosine = ray.z(), distance = (kWall_mm - centre.z()) / ray.z();
        const double radiance =
            kAlbedo / kPi * cosine * kIntensity * std::exp(-kSpread * (1 - ray.z())) / (distance * distance);
        color.Pixel(x, y)[1] =
            static_cast<uint8_t>(std::lround(255 * std::pow(*frame.gain * radiance, 1 / 2.2)));
        if (x % 8 != 4 || y % 8 != 4) continue;
        const Vec3d place = (centre + distance * ray) / kUnit_mm;
        *points += std::to_string(++*point);
        for (int axis = 0; axis < 3; ++axis) *points += " " + std::to_string(place[axis]);
        *points += " 0 0 0 0\n";
        *images +=
            std::to_string(x + 0.5) + " " + std::to_string(y + 0.5) + " " + std::to_string(*point) + " ";
      }
    }
    *images += "\n";
    return color;
  }

  ImportResult Import(double albedo) {
    ImportOptions options;
    options.model = scratch_ / "model";
    options.images = sequence_.folder;
    options.calibration = sequence_.folder;
    options.scale_from_light = true;
    options.albedo = albedo;
    fs::remove_all(scratch_ / "out");
    return ImportModel(options, scratch_ / "out");
  }

  ScratchFolder scratch_;
  Sequence sequence_;
};

TEST_F(ScaleFromLightTest, IsFoundAndGrowsWithTheRootOfTheAlbedo) {
  const double brighter = Import(2 * kAlbedo).mm_per_unit;
  const ImportResult result = Import(kAlbedo);
  // 8-bit steps: half of one is 0.5% of a value of 100, √ of its 2.2th power.
  EXPECT_NEAR(result.mm_per_unit, kUnit_mm, 0.005 * kUnit_mm);
  EXPECT_LT(result.from_light->upper_mm - result.from_light->lower_mm, 0.02 * kUnit_mm);
  EXPECT_EQ(result.from_light->observations, 128);
  EXPECT_NEAR(brighter, result.mm_per_unit * std::sqrt(2), 1e-9);
  const Sequence imported = ReadSequence(scratch_ / "out");
  EXPECT_TRUE(imported.frames[1].world_from_camera.translation().isApprox(Vec3d(3, 0, 2), 0.005));
  EXPECT_EQ(imported.frames[1].gain, 0.9);
}

TEST_F(ScaleFromLightTest, IsRefusedWhereLightOrGainsAreUnknown) {
  sequence_.calibration.light.calibrated = false;
  WriteSequenceHeader(sequence_);
  EXPECT_NE(ErrorOf([&] { Import(kAlbedo); }).find("power is unknown"), std::string::npos);
  sequence_.calibration.light.calibrated = true;
  for (SequenceFrame& frame : sequence_.frames) frame.gain.reset();
  WriteSequenceHeader(sequence_);
  EXPECT_NE(ErrorOf([&] { Import(kAlbedo); }).find("gain of frame 0 is unknown"), std::string::npos);
  WriteFile(scratch_ / "model/points3D.txt", "");
  EXPECT_NE(ErrorOf([&] { Import(kAlbedo); }).find("the model has 0 points"), std::string::npos);
}

// On rendered frames of a colon (albedo 0.35 in green, mottled, with vessels; direct light), the true wall's
// vertices standing for what a structure from motion would have found.
TEST(ScaleFromLight, OfARenderedColon) {
  const Sequence& sequence = test::SmallSequence();
  const Mesh wall = ReadMesh(sequence.ground_truth_mesh);
  const Camera<double> camera(sequence.calibration.camera);
  constexpr double kUnit_mm = 7;
  std::vector<ColmapImage> images;
  std::unordered_map<uint64_t, ColmapPoint> points;
  for (const SequenceFrame& frame : sequence.frames) {
    Sequence alone = sequence;
    alone.frames = {frame};
    const std::vector<int> seen = SeeVertices(RayScene(wall), FrameViews(alone)).frames_seeing;
    ColmapImage& image = images.emplace_back();
    image.camera_from_world = frame.world_from_camera.inverse();
    for (size_t v = 0; v < seen.size(); v += 7) {
      if (!seen[v]) continue;
      points[v].position = wall.vertices[v] / kUnit_mm;
      image.observations.push_back({*camera.Project(image.camera_from_world * wall.vertices[v]), v});
    }
    image.camera_from_world.translation() /= kUnit_mm;
  }
  const LightScale scale = ScaleFromLight(sequence, images, points, 0.35);
  RecordProperty("relative_scale", std::to_string(scale.mm_per_unit / kUnit_mm));
  EXPECT_NEAR(scale.mm_per_unit, kUnit_mm, 0.1 * kUnit_mm);
  EXPECT_GT(scale.observations, 1000);
}

// The command, with poses to go by: a unit of 4 mm comes back from the poses in mm.
TEST_F(ScaleFromLightTest, TheCommandScalesByPoses) {
  const auto lumen = [&](const std::string& more) {
    const std::string command = std::string(LUMEN_COMMAND) + " import '" + (scratch_ / "model").string() +
                                "' --images '" + sequence_.folder.string() + "' -o '" +
                                (scratch_ / "out").string() + "' " + more + " >'" +
                                (scratch_ / "said").string() + "' 2>&1";
    return WEXITSTATUS(std::system(command.c_str()));
  };
  const std::string poses = "--scale-from '" + (sequence_.folder / "pose.txt").string() + "'";
  ASSERT_EQ(lumen(poses), 0) << ReadFile(scratch_ / "said");
  const Sequence imported = ReadSequence(scratch_ / "out");
  EXPECT_TRUE(imported.frames[1].world_from_camera.isApprox(sequence_.frames[1].world_from_camera, 1e-5));
  EXPECT_FALSE(imported.calibration.light.calibrated);  // C3VD's own, where none is given
  EXPECT_NE(ReadFile(scratch_ / "said").find("scale    4 mm a unit"), std::string::npos)
      << ReadFile(scratch_ / "said");
  EXPECT_EQ(lumen(poses), 1);  // the folder isn't empty
  fs::remove_all(scratch_ / "out");
  EXPECT_EQ(lumen(poses + " --scale-from-light"), 2);
  WriteFile(scratch_ / "short.txt", "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1\n");
  EXPECT_EQ(lumen("--scale-from '" + (scratch_ / "short.txt").string() + "'"), 1);
  EXPECT_NE(ReadFile(scratch_ / "said").find("short.txt: 1 poses, but the model has 2 images"),
            std::string::npos);
  fs::remove(sequence_.folder / "0001_color.png");
  EXPECT_EQ(lumen(""), 1);
  EXPECT_NE(ReadFile(scratch_ / "said").find("there is no such file"), std::string::npos);
}

}  // namespace
}  // namespace lumen
