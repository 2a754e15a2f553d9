// A program of its own, small enough to be counted by callgrind: reads a scene and takes its first frame, as
// it is and with some settings after the other.
//
//   lumen_effect_costs SCENE SETTINGS...
//
// A line for each SETTINGS ("a.b=1 c.d=2"): bytes allocated for the wall at the frame's moment, bytes
// allocated for the frame, hash of its pixels.
//
// costs_nothing_test.cpp runs it. It is built from the simulator's own sources, without those that read and
// write images and meshes: their libraries take longer to load than the rest to run. Stand-ins are below.
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <new>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "common/c3vd_camera.h"
#include "common/jpeg.h"
#include "common/parallel.h"
#include "common/progress.h"
#include "sim/cost/frame_setup.h"
#include "sim/geometry/around_path.h"
#include "sim/geometry/mesh_source.h"
#include "sim/trajectory/recorded_path.h"

namespace {
size_t allocated_bytes = 0;
}  // namespace

void* operator new(size_t size) {
  allocated_bytes += size;
  if (void* place = std::malloc(size)) return place;
  throw std::bad_alloc();
}
void* operator new(size_t size, std::align_val_t alignment) {
  allocated_bytes += size;
  const size_t step = static_cast<size_t>(alignment);
  if (void* place = std::aligned_alloc(step, (size + step - 1) / step * step)) return place;
  throw std::bad_alloc();
}
void operator delete(void* place) noexcept { std::free(place); }
void operator delete(void* place, size_t) noexcept { std::free(place); }
void operator delete(void* place, std::align_val_t) noexcept { std::free(place); }
void operator delete(void* place, size_t, std::align_val_t) noexcept { std::free(place); }

namespace lumen {

namespace {
[[noreturn]] void NotHere() { throw std::logic_error("lumen_effect_costs knows procedural scenes only"); }
}  // namespace

Geometry LoadMeshSource(const ConfigTable&) { NotHere(); }
Geometry BuildAroundPath(const ConfigTable&, const std::vector<Pose>&, uint64_t) { NotHere(); }
std::vector<Pose> GivenPoses(const ConfigTable&) { return {}; }
bool IsStandIn(const ConfigTable&) { return false; }
std::vector<Pose> RecordedPoses(const ConfigTable&, const Centreline&, const Clearance&) { NotHere(); }
Image8 ReadImage8(const std::filesystem::path&, int) { NotHere(); }
Image8 C3vdOctagon(int, int) { NotHere(); }
Image8 ThroughJpeg(const Image8& image, int) {
  Image8 coarse = image;
  for (uint8_t& value : coarse.data) value &= 0xf0;
  return coarse;
}

}  // namespace lumen

namespace {
struct Frame {
  lumen::Image8 picture;
  size_t wall_bytes, bytes;  // allocated for the wall at the frame's moment, and for what takes the frame
};
}  // namespace

// The two parts that are counted, by names that callgrind's options can tell.
extern "C" {

[[gnu::noinline]] void ReadPart(const char* file, const std::vector<std::string>& settings,
                                std::optional<lumen::Scene>* scene) {
  scene->emplace(lumen::ReadScene(file, settings, 1));
}

[[gnu::noinline]] void FramePart(const lumen::Scene& scene, Frame* frame) {
  lumen::MovingWall walls(scene.geometry, {scene.peristalsis, scene.surface.coat.has_value()});
  const size_t before = allocated_bytes;
  walls.At(0);
  const size_t with_wall = allocated_bytes;
  frame->picture = lumen::FrameSetup(scene, &walls, 0, 1).Take(1);
  frame->wall_bytes = with_wall - before;
  frame->bytes = allocated_bytes - with_wall;
}
}

int main(int argc, char** argv) {
  lumen::SetThreadCount(1);
  lumen::SetQuiet(true);
  for (int i = 2; i < argc; ++i) {
    std::optional<lumen::Scene> scene;
    std::istringstream words(argv[i]);
    ReadPart(argv[1], {std::istream_iterator<std::string>(words), {}}, &scene);
    Frame frame;
    FramePart(*scene, &frame);
    const std::vector<uint8_t>& data = frame.picture.data;
    const std::string_view bytes(reinterpret_cast<const char*>(data.data()), data.size());
    std::printf("%zu %zu %zu\n", frame.wall_bytes, frame.bytes, std::hash<std::string_view>()(bytes));
  }
  return 0;
}
