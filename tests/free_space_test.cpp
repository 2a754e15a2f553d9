// Cameras stay in the lumen: the loss of those that the wall closes over.
#include "recon/training/free_space.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/finite_difference.h"

namespace lumen {
namespace {

// A tube of radius 14 mm along z, with a grid whose entries are drawn at random.
struct Wall {
  Wall() : Wall(FieldOptions()) {}
  explicit Wall(FieldOptions options) : field(Shaped(&options), Tube(options), Box()) {
    parameters.resize(field.parameter_count());
    field.Initialise(3, parameters.data());
    uint64_t state = 5;
    for (double& p : parameters) p += 0.02 * test::Random(state);
  }
  static FieldOptions Shaped(FieldOptions* options) {
    options->grid.levels = 2;
    options->grid.coarsest_cell_mm = 20;
    options->grid.finest_cell_mm = 10;
    options->grid.log2_table_size = 8;
    options->initial.shape = InitialShape::kTube;
    return *options;
  }
  static InitialSurface Tube(const FieldOptions& options) {
    return InitialSurface(options.initial, {Pose::Identity()}, Vec3d::Zero());
  }
  static Eigen::AlignedBox3d Box() { return {Vec3d::Constant(-60), Vec3d::Constant(60)}; }
  double At(const Vec3d& place) const {
    Field<double>::ValuePass pass;
    pass.positions.Resize(3, 1);
    for (int i = 0; i < kTile; ++i)
      for (int d = 0; d < 3; ++d) pass.positions.At(d, i) = place[d];
    field.Value(parameters.data(), &pass);
    return pass.value.At(0, 0);
  }

  Field<double> field;
  std::vector<double> parameters;
};

// More places than a tile holds, at an odd number; on the axis, and out of the wall by 20 mm and more.
std::vector<Vec3d> Places() {
  std::vector<Vec3d> places;
  for (int i = 0; i < 2 * kTile + 5; ++i) {
    places.emplace_back(i % 3 == 0 ? 0.0 : 34 + 0.1 * i, 0.3 * i, 2 + 0.1 * i);
  }
  return places;
}

TEST(FreeSpace, LossIsWhatPlacesLackOfTheClearance) {
  const Wall wall;
  FreeSpace<double> free_space(&wall.field);
  std::vector<double> unused(wall.field.network_size());
  double expected = 0;
  for (const Vec3d& place : Places()) expected += std::max(0.0, 0.5 - wall.At(place));
  expected *= 3.0 / static_cast<double>(Places().size());
  const double loss = free_space.Evaluate(wall.parameters.data(), Places(), 0.5, 3.0, unused.data());
  EXPECT_NEAR(loss, expected, 1e-12 * expected);
  EXPECT_GT(loss, 3 * 10.0 * 2 / 3);
}

TEST(FreeSpace, GradientMatchesFiniteDifferences) {
  Wall wall;
  FreeSpace<double> free_space(&wall.field);
  std::vector<double> unused(wall.field.network_size()), gradient(wall.field.parameter_count(), 0.0);
  const std::vector<Vec3d> places = Places();
  free_space.Evaluate(wall.parameters.data(), places, 0.5, 0.7, gradient.data() + wall.field.grid_size());
  for (int level = 0; level < wall.field.grid().levels(); ++level) {
    free_space.GridBackward(level, gradient.data());
  }
  const auto loss = [&] {
    return FreeSpace<double>(&wall.field).Evaluate(wall.parameters.data(), places, 0.5, 0.7, unused.data());
  };
  int in_grid = 0, in_networks = 0;
  for (size_t i = 0; i < gradient.size(); ++i) {
    const double expected = test::Difference(loss, &wall.parameters[i], 1e-6);
    EXPECT_NEAR(gradient[i], expected, 1e-6 * std::max(1.0, std::abs(expected))) << "parameter " << i;
    (i < wall.field.grid_size() ? in_grid : in_networks) += expected != 0;
  }
  EXPECT_GT(in_grid, 20);
  EXPECT_GT(in_networks, 100);
}

// What a run whose cameras are in the lumen learns is what it would have learnt without.
TEST(FreeSpace, LeavesAloneWhatHasItsClearance) {
  const Wall wall;
  FreeSpace<double> free_space(&wall.field);
  std::vector<double> gradient(wall.field.parameter_count(), 0.0);
  const std::vector<Vec3d> places(3, Vec3d(0, 0, 5));
  ASSERT_GT(wall.At(places[0]), 0.5);
  EXPECT_EQ(
      free_space.Evaluate(wall.parameters.data(), places, 0.5, 1.0, gradient.data() + wall.field.grid_size()),
      0);
  free_space.GridBackward(0, gradient.data());
  for (double g : gradient) EXPECT_EQ(g, 0);
}

TEST(FreeSpace, BringsBackACameraInTheWall) {
  Wall wall;
  FreeSpace<double> free_space(&wall.field);
  const std::vector<Vec3d> places = {Vec3d(30, 0, 10), Vec3d(0, 0, 10)};
  ASSERT_LT(wall.At(places[0]), -10);
  std::vector<double> gradient(wall.parameters.size());
  double loss = 1;
  for (int step = 0; step < 500 && loss > 0; ++step) {
    std::fill(gradient.begin(), gradient.end(), 0.0);
    loss = free_space.Evaluate(wall.parameters.data(), places, 0.5, 1.0,
                               gradient.data() + wall.field.grid_size());
    for (int level = 0; level < wall.field.grid().levels(); ++level) {
      free_space.GridBackward(level, gradient.data());
    }
    // As Adam's first steps: all parameters by as much.
    for (size_t i = 0; i < gradient.size(); ++i) {
      if (gradient[i] != 0) wall.parameters[i] -= std::copysign(1e-3, gradient[i]);
    }
  }
  for (const Vec3d& place : places) EXPECT_GE(wall.At(place), 0.5);
}

}  // namespace
}  // namespace lumen
