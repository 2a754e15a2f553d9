// Sequences in other programs' formats, read by an independent reader (Python's standard library) and back.
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <sstream>

#include "common/c3vd_camera.h"
#include "common/files.h"
#include "common/line_reader.h"
#include "common/pose_file.h"
#include "common/progress.h"
#include "common/random.h"
#include "sim/render.h"
#include "tests/support.h"
#include "tools/exchange/export_sequence.h"
#include "tools/exchange/import_model.h"
#include "tools/exchange/rectification.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;
using test::ErrorOf;
using test::ScratchFolder;

Calibration CalibrationOf(const CameraIntrinsics& camera) {
  Calibration calibration;
  calibration.camera = camera;
  calibration.light.sources.resize(1);
  return calibration;
}

// An octagon's worth of C3VD's camera, as small as one likes.
Calibration C3vdOf(int width, int height) {
  Calibration calibration = CalibrationOf(Resized(C3vdIntrinsics(), width, height));
  calibration.mask = C3vdOctagon(width, height);
  return calibration;
}

CameraIntrinsics Pinhole() {
  CameraIntrinsics camera;
  camera.width = 80;
  camera.height = 60;
  camera.cx = 41.25;
  camera.cy = 28.5;
  camera.fx = 50;
  camera.fy = 51;
  return camera;
}

// Some frames, winding along a tube, with a colour file each; numbers with a gap.
Sequence Winding(const fs::path& folder, const Calibration& calibration) {
  Sequence sequence;
  sequence.folder = folder;
  sequence.has_toml = true;
  sequence.calibration = calibration;
  CreateFolder(folder);
  for (int i = 0; i < 5; ++i) {
    SequenceFrame frame;
    frame.number = i < 3 ? i : i + 7;
    frame.world_from_camera.linear() = (Eigen::AngleAxisd(0.9 * i, Vec3d::UnitZ()) *
                                        Eigen::AngleAxisd(0.2 * i - 1, Vec3d(1, 2, 0).normalized()))
                                           .toRotationMatrix();
    frame.world_from_camera.translation() = Vec3d(100 + std::sin(i), 1e-3 * i, -7 * i);
    frame.color = FrameFile(folder, frame.number, "color.png");
    Image8 color(calibration.camera.width, calibration.camera.height, 3);
    for (size_t k = 0; k < color.data.size(); ++k) color.data[k] = static_cast<uint8_t>(k * (i + 3) % 251);
    WriteImage(frame.color, color);
    sequence.frames.push_back(frame);
  }
  WriteSequenceHeader(sequence);
  return sequence;
}

// OpenCV's fisheye as its documentation has it.
Vec2d FisheyePixel(const CameraIntrinsics& in, const Vec3d& point) {
  const double a = point.x() / point.z(), b = point.y() / point.z(), r = std::hypot(a, b);
  const double t = std::atan(r);
  const double distorted = t * (1 + in.k[0] * std::pow(t, 2) + in.k[1] * std::pow(t, 4) +
                                in.k[2] * std::pow(t, 6) + in.k[3] * std::pow(t, 8));
  return {in.fx * distorted / r * a + in.cx, in.fy * distorted / r * b + in.cy};
}

TEST(FisheyeFit, TakesAFisheyeAsItIs) {
  Calibration calibration = CalibrationOf(EndomapperIntrinsics());
  const FisheyeFit fit = FitFisheye(calibration);
  EXPECT_EQ(fit.camera.k, calibration.camera.k);
  EXPECT_LT(fit.max_px, 1e-9);
  EXPECT_EQ(fit.roll_rad, 0);
  EXPECT_GT(fit.unfitted, 0);  // some of the image lies beyond 87°
}

TEST(FisheyeFit, FitsC3vdsCameraAsWellAsItSays) {
  const Calibration calibration = C3vdCalibration();
  const FisheyeFit fit = FitFisheye(calibration);
  RecordProperty("max_px", std::to_string(fit.max_px));
  EXPECT_LT(fit.max_px, 0.5);
  EXPECT_LT(fit.rms_px, 0.1);
  EXPECT_EQ(fit.unfitted, 0);
  // What others have published for the scope, as far as another calibration can agree with this one.
  EXPECT_NEAR(fit.camera.fx, 767.39, 4);
  EXPECT_NEAR(fit.camera.cx, 679.05, 3);
  EXPECT_NEAR(fit.camera.k[0], -0.18867, 0.03);
  // The error that it states, by the formula in OpenCV's documentation.
  const Camera<double> ours(calibration.camera);
  const Image8 valid = ValidPixels(calibration);
  double largest = 0, unrolled = 0;
  for (int y = 0; y < valid.height; y += 3) {
    for (int x = 0; x < valid.width; x += 3) {
      if (!*valid.Pixel(x, y)) continue;
      const Vec3d ray = *ours.Unproject(Vec2d(x, y));
      const Vec3d turned = Eigen::AngleAxisd(fit.roll_rad, Vec3d::UnitZ()) * ray;
      largest = std::max(largest, (FisheyePixel(fit.camera, turned) - Vec2d(x, y)).norm());
      unrolled = std::max(unrolled, (FisheyePixel(fit.camera, ray) - Vec2d(x, y)).norm());
    }
  }
  EXPECT_NEAR(largest, fit.max_px, 0.02);
  EXPECT_GT(unrolled, fit.max_px + 1);
}

TEST(FisheyeFit, SaysWhereItDoesNotFit) {
  Calibration calibration = C3vdOf(135, 108);
  calibration.camera.stretch[2] = 0.1;  // sheared
  EXPECT_GT(FitFisheye(calibration).max_px, 1);
  const ScratchFolder scratch;
  const Sequence sequence = Winding(scratch / "sequence", calibration);
  const std::string error = ErrorOf([&] { ExportSequence(sequence, {}, scratch / "out"); });
  EXPECT_NE(error.find("an OpenCV fisheye fits the camera to "), std::string::npos) << error;
  EXPECT_NE(error.find("--rectify"), std::string::npos);
  EXPECT_FALSE(fs::exists(scratch / "out"));
  ExportOptions rectify;
  rectify.rectify = true;
  EXPECT_EQ(ExportSequence(sequence, rectify, scratch / "out").camera.model, CameraModel::kPinhole);
}

// A picture whose colours are a function of the direction.
Rgb8 Painted(const Vec3d& direction) {
  Rgb8 color;
  for (int c = 0; c < 3; ++c) {
    color[c] = static_cast<uint8_t>(std::lround(127 + 100 * std::sin(3 * direction[c] + c)));
  }
  return color;
}

TEST(Rectification, ShowsWhatAPinholeWouldHaveSeen) {
  const Calibration calibration = C3vdOf(270, 216);
  const Camera<double> camera(calibration.camera);
  Image8 color(270, 216, 3);
  for (int y = 0; y < 216; ++y) {
    for (int x = 0; x < 270; ++x) {
      const auto ray = camera.Unproject(Vec2d(x, y));
      if (ray) std::memcpy(color.Pixel(x, y), Painted(*ray).data(), 3);
    }
  }
  const Rectification rectification(calibration, 110);
  EXPECT_NEAR(2 * std::atan(135 / rectification.camera().fx) * 180 / kPi, 110, 1e-9);
  const Image8 image = rectification.Apply(color);
  const Camera<double> pinhole(rectification.camera());
  int seen = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const bool carries = *rectification.mask().Pixel(x, y);
      seen += carries;
      const Rgb8 expected = carries ? Painted(*pinhole.Unproject(Vec2d(x, y))) : Rgb8{0, 0, 0};
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(image.Pixel(x, y)[c], expected[c], 2) << x << " " << y;
    }
  }
  EXPECT_GT(seen, 0.8 * 270 * 216);
  EXPECT_LT(seen, 270 * 216);  // the octagon's corners are missing
  EXPECT_NE(ErrorOf([&] { Rectification(calibration, 180); }), "");
}

// Reads an export and projects world points into every image, by each format's own conventions and nothing
// of ours; pixels as the format counts them.
constexpr char kPython[] = R"(
import json, math, os, struct, sys, zipfile
folder, kind = sys.argv[1], sys.argv[2]
points = [tuple(map(float, p.split(','))) for p in sys.argv[3:]]

def apply(m, p):
    return [sum(m[r][c] * (list(p) + [1])[c] for c in range(4)) for r in range(3)]

def fisheye(fx, fy, cx, cy, k, p):
    a, b = p[0] / p[2], p[1] / p[2]
    r = math.hypot(a, b)
    t = math.atan(r)
    d = t * (1 + k[0] * t**2 + k[1] * t**4 + k[2] * t**6 + k[3] * t**8)
    return fx * d / r * a + cx, fy * d / r * b + cy

def colmap():
    lines = [l for l in open(folder + '/sparse/0/cameras.txt') if l[0] != '#']
    assert len(lines) == 1
    words = lines[0].split()
    p = list(map(float, words[4:]))
    assert len(p) == {'PINHOLE': 4, 'OPENCV_FISHEYE': 8}[words[1]]
    lines = [l for l in open(folder + '/sparse/0/images.txt') if l[0] != '#']
    for line in lines[0::2]:
        words = line.split()
        w, x, y, z, tx, ty, tz = map(float, words[1:8])
        assert os.path.exists(folder + '/images/' + words[9])
        m = [[1 - 2*(y*y + z*z), 2*(x*y - z*w), 2*(x*z + y*w), tx],
             [2*(x*y + z*w), 1 - 2*(x*x + z*z), 2*(y*z - x*w), ty],
             [2*(x*z - y*w), 2*(y*z + x*w), 1 - 2*(x*x + y*y), tz]]
        for point in points:
            q = apply(m, point)
            if len(p) == 8: print(*fisheye(*p[:4], p[4:], q))
            else: print(p[0] * q[0] / q[2] + p[2], p[1] * q[1] / q[2] + p[3])

def nerfstudio():
    j = json.load(open(folder + '/transforms.json'))
    for frame in j['frames']:
        assert os.path.exists(os.path.join(folder, frame['file_path']))
        assert os.path.exists(os.path.join(folder, frame['mask_path']))
        m = frame['transform_matrix']
        for point in points:
            d = [point[i] - m[i][3] for i in range(3)]
            q = [sum(m[r][c] * d[r] for r in range(3)) for c in range(3)]
            q = [q[0], -q[1], -q[2]]
            if j['camera_model'] == 'OPENCV_FISHEYE':
                k = [j['k%d' % i] for i in (1, 2, 3, 4)]
                print(*fisheye(j['fl_x'], j['fl_y'], j['cx'], j['cy'], k, q))
            else:
                assert j['camera_model'] == 'OPENCV' and j['k1'] == j['p2'] == 0
                print(j['fl_x'] * q[0] / q[2] + j['cx'], j['fl_y'] * q[1] / q[2] + j['cy'])

def npy(archive, name):
    data = archive.read(name + '.npy')
    assert data[:8] == b'\x93NUMPY\x01\x00'
    size, = struct.unpack('<H', data[8:10])
    assert (10 + size) % 64 == 0
    assert eval(data[10:10 + size]) == {'descr': '<f8', 'fortran_order': False, 'shape': (4, 4)}
    values = struct.unpack('<16d', data[10 + size:])
    return [values[4*i:4*i + 4] for i in range(4)]

def neus():
    archive = zipfile.ZipFile(folder + '/cameras_sphere.npz')
    assert archive.testzip() is None
    images = sorted(os.listdir(folder + '/image'))
    assert images == sorted(os.listdir(folder + '/mask'))
    for i in range(len(images)):
        world, scale = npy(archive, 'world_mat_%d' % i), npy(archive, 'scale_mat_%d' % i)
        for point in points:
            # What lies within 100 mm of a camera is in the unit sphere.
            unit = [(point[r] - scale[r][3]) / scale[r][r] for r in range(3)]
            assert math.hypot(*unit) < 1
            q = apply(world, apply(scale, unit))
            print(q[0] / q[2], q[1] / q[2])

dict(colmap=colmap, nerfstudio=nerfstudio, neus=neus)[kind]()
)";

// What a command prints; it must succeed.
std::string OutputOf(const std::string& command) {
  FILE* pipe = popen(command.c_str(), "r");
  std::string output;
  char buffer[4096];
  for (size_t count; (count = fread(buffer, 1, sizeof buffer, pipe)) > 0;) output.append(buffer, count);
  EXPECT_EQ(pclose(pipe), 0) << command;
  return output;
}

// Holds an export against the sequence's own camera: every world point must come to its pixel within
// tolerance_px, after the format's offset.
void ExpectSameProjections(const Sequence& sequence, const CameraIntrinsics& camera, const fs::path& folder,
                           const std::string& kind, double offset_px, double tolerance_px) {
  std::vector<Vec3d> points;
  for (const SequenceFrame& frame : sequence.frames) {
    for (const Vec3d& ahead : {Vec3d(1, 2, 9), Vec3d(-9, 4, 21), Vec3d(20, -30, 60)}) {
      points.push_back(frame.world_from_camera * ahead);
    }
  }
  const ScratchFolder scratch;
  WriteFile(scratch / "reader.py", kPython);
  std::string command =
      "/usr/bin/python3 '" + (scratch / "reader.py").string() + "' '" + folder.string() + "' " + kind;
  for (const Vec3d& p : points) {
    for (int axis = 0; axis < 3; ++axis) AppendNumber(&(command += axis == 0 ? " " : ","), p[axis]);
  }
  std::istringstream output(OutputOf(command));
  const Camera<double> ours(camera);
  int compared = 0;
  for (const SequenceFrame& frame : sequence.frames) {
    for (const Vec3d& p : points) {
      double x = 0, y = 0;
      ASSERT_TRUE(output >> x >> y);
      const Vec3d local = frame.world_from_camera.inverse() * p;
      const auto pixel = ours.Project(local);
      const bool in_image = pixel && local.z() > 0.3 * local.norm() && pixel->x() > 0 && pixel->y() > 0 &&
                            pixel->x() < camera.width && pixel->y() < camera.height;
      if (!in_image) continue;
      EXPECT_LT((Vec2d(x, y) - Vec2d::Constant(offset_px) - *pixel).norm(), tolerance_px)
          << kind << ": " << p.transpose();
      ++compared;
    }
  }
  EXPECT_GE(compared, 15);
}

class Export : public testing::Test {
 protected:
  Export() { SetQuiet(true); }
  ExportResult Write(const Sequence& sequence, ExportFormat format, bool rectify = false) {
    ExportOptions options;
    options.format = format;
    options.rectify = rectify;
    return ExportSequence(sequence, options, scratch_ / "out");
  }
  ScratchFolder scratch_;
};

TEST_F(Export, ColmapIsReadByPython) {
  const Sequence sequence = Winding(scratch_ / "in", C3vdOf(135, 108));
  const ExportResult result = Write(sequence, ExportFormat::kColmap);
  EXPECT_LT(result.fit->max_px, 0.05);
  ExpectSameProjections(sequence, sequence.calibration.camera, scratch_ / "out", "colmap", 0.5,
                        result.fit->max_px + 1e-9);
}

TEST_F(Export, NerfstudioIsReadByPython) {
  const Sequence sequence = Winding(scratch_ / "in", C3vdOf(135, 108));
  const ExportResult result = Write(sequence, ExportFormat::kNerfstudio);
  ExpectSameProjections(sequence, sequence.calibration.camera, scratch_ / "out", "nerfstudio", 0.5,
                        result.fit->max_px + 1e-9);
}

TEST_F(Export, NeusIsReadByPython) {
  const Sequence sequence = Winding(scratch_ / "in", C3vdOf(135, 108));
  const ExportResult result = Write(sequence, ExportFormat::kNeus);
  ExpectSameProjections(sequence, result.camera, scratch_ / "out", "neus", 0, 1e-9);
  EXPECT_GT(result.sphere_radius_mm, 114);  // the cameras' path, 28 mm and some long, lies within
  EXPECT_LT(result.sphere_radius_mm, 116);
}

TEST_F(Export, PinholesStayAsTheyAre) {
  const Sequence sequence = Winding(scratch_ / "in", CalibrationOf(Pinhole()));
  for (const auto& [format, kind, offset_px] : {std::tuple(ExportFormat::kColmap, "colmap", 0.5),
                                                std::tuple(ExportFormat::kNerfstudio, "nerfstudio", 0.5),
                                                std::tuple(ExportFormat::kNeus, "neus", 0.0)}) {
    fs::remove_all(scratch_ / "out");
    Write(sequence, format, true);
    ExpectSameProjections(sequence, Pinhole(), scratch_ / "out", kind, offset_px, 1e-9);
  }
  EXPECT_EQ(ReadFile(scratch_ / "out/image/0010.png"), ReadFile(sequence.frames[3].color));
}

// As COLMAP says, and to the last digit but one: poses within 1e-9 and the fisheye itself.
TEST_F(Export, ComesBackFromColmap) {
  const Sequence sequence =
      Winding(scratch_ / "in", CalibrationOf(Resized(EndomapperIntrinsics(), 144, 108)));
  Write(sequence, ExportFormat::kColmap);
  ImportOptions options;
  options.model = scratch_ / "out/sparse/0";
  options.images = scratch_ / "out/images";
  const ImportResult imported = ImportModel(options, scratch_ / "back");
  EXPECT_EQ(imported.frames, 5);
  const Sequence back = ReadSequence(scratch_ / "back");
  const CameraIntrinsics &a = sequence.calibration.camera, &b = back.calibration.camera;
  EXPECT_EQ(a.k, b.k);
  EXPECT_EQ(a.fx, b.fx);
  EXPECT_NEAR(a.cx, b.cx, 1e-12);
  ASSERT_EQ(back.frames.size(), 5u);
  for (int i = 0; i < 5; ++i) {
    const SequenceFrame &from = sequence.frames[i], &to = back.frames[i];
    EXPECT_EQ(from.number, to.number);
    EXPECT_EQ(ReadFile(from.color), ReadFile(to.color));
    EXPECT_TRUE(from.world_from_camera.isApprox(to.world_from_camera, 1e-9));
  }
}

// Of C3VD's camera the fit's error is left, in px, and nothing else.
TEST_F(Export, C3vdComesBackFromColmapToTheFitsError) {
  const Sequence sequence = Winding(scratch_ / "in", C3vdOf(135, 108));
  const ExportResult result = Write(sequence, ExportFormat::kColmap);
  ImportOptions options;
  options.model = scratch_ / "out/sparse/0";
  options.images = scratch_ / "out/images";
  ImportModel(options, scratch_ / "back");
  const Sequence back = ReadSequence(scratch_ / "back");
  const Camera<double> ours(sequence.calibration.camera), theirs(back.calibration.camera);
  const Image8 valid = ValidPixels(sequence.calibration);
  for (int i = 0; i < 5; ++i) {
    const Pose &from = sequence.frames[i].world_from_camera, &to = back.frames[i].world_from_camera;
    EXPECT_LT((from.translation() - to.translation()).norm(), 1e-9 * from.translation().norm());
    double largest = 0;
    for (int y = 0; y < valid.height; ++y) {
      for (int x = 0; x < valid.width; ++x) {
        if (!*valid.Pixel(x, y)) continue;
        const Vec3d world = from.linear() * *ours.Unproject(Vec2d(x, y));
        largest = std::max(largest, (*theirs.Project(to.linear().transpose() * world) - Vec2d(x, y)).norm());
      }
    }
    EXPECT_NEAR(largest, result.fit->max_px, 1e-9);
  }
}

// With the sequence that was exported as the calibration its camera and its poses come back, not the
// fisheye's.
TEST_F(Export, C3vdComesBackWholeWithItsCalibration) {
  const Sequence sequence = Winding(scratch_ / "in", C3vdOf(135, 108));
  const ExportResult result = Write(sequence, ExportFormat::kColmap);
  EXPECT_GT(std::abs(result.fit->roll_rad), 1e-3);
  ImportOptions options;
  options.model = scratch_ / "out/sparse/0";
  options.images = scratch_ / "out/images";
  options.calibration = scratch_ / "in";
  EXPECT_EQ(ImportModel(options, scratch_ / "back").turned_back_rad, result.fit->roll_rad);
  const Sequence back = ReadSequence(scratch_ / "back");
  const CameraIntrinsics &a = sequence.calibration.camera, &b = back.calibration.camera;
  EXPECT_EQ(b.model, CameraModel::kScaramuzza);
  EXPECT_EQ(a.a, b.a);
  EXPECT_EQ(a.stretch, b.stretch);
  EXPECT_EQ(Vec2d(a.cx, a.cy), Vec2d(b.cx, b.cy));
  EXPECT_EQ(sequence.calibration.mask.data, back.calibration.mask.data);
  ASSERT_EQ(back.frames.size(), sequence.frames.size());
  const auto largest_difference = [&](const Sequence& other) {
    double largest = 0;
    for (size_t i = 0; i < sequence.frames.size(); ++i) {
      const auto difference =
          sequence.frames[i].world_from_camera.matrix() - other.frames[i].world_from_camera.matrix();
      largest = std::max(largest, difference.cwiseAbs().maxCoeff());
    }
    return largest;
  };
  EXPECT_LT(largest_difference(back), 1e-9);

  // A camera that has been refined since stays the model's own.
  std::string cameras = ReadFile(options.model / "cameras.txt");
  cameras.insert(cameras.find_last_of('.') + 1, "1");
  WriteFile(options.model / "cameras.txt", cameras);
  EXPECT_FALSE(ImportModel(options, scratch_ / "refined").turned_back_rad);
  EXPECT_GT(largest_difference(ReadSequence(scratch_ / "refined")), 1e-3);
}

// COLMAP's points as its documentation has them: a track's images have an observation of the point at the
// place that the track names, the model projects the point to them within the error that is written, and they
// see no other wall there: the frames' depth files, ray-traced, say how far it is.
constexpr char kPointsReader[] = R"(
import math, sys
def lines(name): return open(sys.argv[1] + '/' + name).read().split('\n')
rows = [l for l in lines('images.txt') if not l.startswith('#')]
seen = {}
for head, body in zip(rows[::2], rows[1::2]):
    words = body.split()
    seen[int(head.split()[0])] = [(float(x), float(y), int(p)) for x, y, p in zip(*[iter(words)] * 3)]
points, tracked = 0, 0
for line in lines('points3D.txt'):
    if not line or line.startswith('#'): continue
    words = line.split()
    assert all(0 <= int(c) <= 255 for c in words[4:7])
    assert float(words[7]) < 0.06
    track = [(int(a), int(b)) for a, b in zip(*[iter(words[8:])] * 2)]
    assert len(track) >= 2 and len(set(a for a, b in track)) == len(track)
    for image, place in track: assert seen[image][place][2] == int(words[0])
    points += 1
    tracked += len(track)
assert tracked == sum(map(len, seen.values()))
print(points, tracked)
)";

TEST_F(Export, PointsAreTheWallsAndSeenWhereTheySay) {
  const Scene scene = ReadScene(LUMEN_SOURCE_FOLDER "/scenes/colon.toml",
                                {"camera.width=135", "camera.height=108", "camera.mask=octagon",
                                 "trajectory.frames=4", "path.samples=1", "geometry.tolerance_mm=0.3"},
                                0);
  RenderOptions render;
  render.folder = scratch_ / "in";
  Render(scene, render);
  const Sequence sequence = ReadSequence(render.folder);
  ExportOptions options;
  options.points = 3000;
  for (const bool rectify : {false, true}) {
    fs::remove_all(scratch_ / "out");
    options.rectify = rectify;
    const ExportResult result = ExportSequence(sequence, options, scratch_ / "out");
    EXPECT_GT(result.points, 500);
    WriteFile(scratch_ / "points.py", kPointsReader);
    EXPECT_EQ(OutputOf("/usr/bin/python3 '" + (scratch_ / "points.py").string() + "' '" +
                       (scratch_ / "out/sparse/0").string() + "'"),
              std::to_string(result.points) + " " + std::to_string(result.observations) + "\n");

    const ColmapModel model = ReadColmapModel(scratch_ / "out/sparse/0");
    const Camera<double> camera(FromColmap(model.cameras[0])), own(sequence.calibration.camera);
    int64_t compared = 0, off = 0;
    for (size_t i = 0; i < model.images.size(); ++i) {
      const ImageF depth = DecodeDepth(ReadImage16(sequence.frames[i].depth, 1));
      for (const ColmapObservation& observation : model.images[i].observations) {
        const ColmapPoint& point = model.points.at(observation.point);
        const Vec3d local = model.images[i].camera_from_world * point.position;
        EXPECT_LT((camera.Project(local).value() - observation.pixel).norm(), rectify ? 1e-3 : 0.1);
        const Vec2d at = own.Project(sequence.frames[i].world_from_camera.inverse() * point.position).value();
        const float z = *depth.Pixel(int(std::lround(at.x())), int(std::lround(at.y())));
        ++compared;
        off += !(std::abs(z - local.z()) < 0.05 * local.z());
      }
    }
    EXPECT_EQ(compared, result.observations);
    // Half a pixel off, on a wall seen from the side or over a fold's edge.
    EXPECT_LT(off, 0.05 * double(compared)) << off << " of " << compared;
  }
}

TEST_F(Export, LeavesWhatIsThereAlone) {
  const Sequence sequence = Winding(scratch_ / "in", CalibrationOf(Pinhole()));
  WriteFile(scratch_ / "out.txt", "");
  CreateFolder(scratch_ / "out");
  WriteFile(scratch_ / "out/mine", "");
  EXPECT_NE(ErrorOf([&] { Write(sequence, ExportFormat::kColmap); }).find("is not empty"), std::string::npos);
}

}  // namespace
}  // namespace lumen
