#include "sim/imaging/wall_places.h"

#include <algorithm>
#include <cmath>

#include "common/random.h"

namespace lumen {
namespace {

// Some 100 bytes each; parts of an edge.
constexpr double kMostPlaces = 2e6, kMostParts = 4096;
// The numbers that a cube draws: three for its point, then this.
constexpr uint64_t kRankNumber = 3;

double LongestEdge(const Mesh& mesh, const Vec3i& face) {
  double longest = 0;
  for (int c = 0; c < 3; ++c) {
    longest = std::max(longest, (mesh.vertices[face[c]] - mesh.vertices[face[(c + 1) % 3]]).norm());
  }
  return longest;
}

class WallSampler {
 public:
  WallSampler(const Mesh& wall, double pitch_mm, uint64_t seed)
      : wall_(wall), middle_(Bounds(wall).center()), pitch_mm_(pitch_mm), seed_(seed) {}

  std::vector<WallPlace> Run() {
    const std::vector<Vec3d> normals = VertexNormals(wall_);
    for (const Vec3i& face : wall_.faces) OfferFace(face, normals);
    std::vector<WallPlace> places;
    places.reserve(chosen_.size());
    for (const auto& [key, chosen] : chosen_) places.push_back(chosen.place);
    std::sort(places.begin(), places.end(), [](const auto& a, const auto& b) { return a.rank < b.rank; });
    return places;
  }

 private:
  struct Chosen {
    WallPlace place;
    double squared;  // distance to the cube's random point, in pitches
  };

  // The middles of equal triangles whose edges are no longer than the pitch.
  void OfferFace(const Vec3i& face, const std::vector<Vec3d>& vertex_normals) {
    Mat3<double> corners, normals;
    for (int c = 0; c < 3; ++c) {
      corners.col(c) = wall_.vertices[face[c]] - middle_;
      normals.col(c) = vertex_normals[face[c]];
    }
    const int parts = std::max(1, static_cast<int>(std::ceil(LongestEdge(wall_, face) / pitch_mm_)));
    for (int i = 0; i < parts; ++i) {
      for (int j = 0; i + j < parts; ++j) {
        const double u = (i + 1.0 / 3) / parts, v = (j + 1.0 / 3) / parts;
        const Vec3d weights(1 - u - v, u, v), normal = normals * weights;
        if (normal.squaredNorm() > 0) Offer(corners * weights, normal.normalized());
      }
    }
  }

  void Offer(const Vec3d& place_mm, const Vec3d& normal) {
    // A lattice in no special place: on its planes rounding would choose the cube, and walls may be
    // symmetric.
    const Vec3d in_lattice = place_mm / pitch_mm_ + PointOf(0);
    const Vec3i cube = CubeOf(in_lattice, 1);
    const uint64_t key = KeyOf(cube);
    const double squared = (in_lattice - cube.cast<double>() - PointOf(key)).squaredNorm();
    const auto [entry, is_new] = chosen_.try_emplace(key);
    if (is_new || squared < entry->second.squared)
      entry->second = {{place_mm, normal, RandomBits(seed_, key, kRankNumber)}, squared};
  }

  // A random point of the unit cube.
  Vec3d PointOf(uint64_t key) const {
    return {UniformDouble(RandomBits(seed_, key, 0)), UniformDouble(RandomBits(seed_, key, 1)),
            UniformDouble(RandomBits(seed_, key, 2))};
  }

  const Mesh& wall_;
  const Vec3d middle_;
  const double pitch_mm_;
  const uint64_t seed_;
  std::unordered_map<uint64_t, Chosen> chosen_;
};

}  // namespace

std::vector<WallPlace> SampleWall(const Mesh& wall, double pitch_mm, uint64_t seed) {
  return WallSampler(wall, pitch_mm, seed).Run();
}

double LeastPitch(const Mesh& wall) {
  double area_mm2 = 0, longest_mm = 0;
  for (size_t f = 0; f < wall.faces.size(); ++f) {
    area_mm2 += FaceArea(wall, static_cast<int>(f));
    longest_mm = std::max(longest_mm, LongestEdge(wall, wall.faces[f]));
  }
  return std::max(std::sqrt(area_mm2 / kMostPlaces), longest_mm / kMostParts);
}

std::vector<WallPlace> Scatter(const std::vector<WallPlace>& places, double distance_mm) {
  std::vector<WallPlace> scattered;
  CubeMap taken(distance_mm);
  for (const WallPlace& place : places) {
    bool free = true;
    taken.ForEachNear(place.place_mm, [&](int i) {
      free &= (scattered[i].place_mm - place.place_mm).squaredNorm() >= distance_mm * distance_mm ||
              !FacesAlike(scattered[i].normal, place.normal);
    });
    if (!free) continue;
    taken.Add(place.place_mm, static_cast<int>(scattered.size()));
    scattered.push_back(place);
  }
  return scattered;
}

}  // namespace lumen
