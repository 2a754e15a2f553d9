// The neural surface: a signed distance (positive in the lumen, negative in the wall) and what the surface
// looks like, as functions of place. Signed distance = initial surface + unit · network(encoded place,
// place), cut off by the distance to the bounds, so that every ray ends. Place is encoded by a grid, by
// frequencies, or by both.
//
// All positions are in mm, relative to the field's origin, in panels of 3 rows.
#pragma once

#include <cstdint>
#include <vector>

#include "recon/network/frequency.h"
#include "recon/network/grid.h"
#include "recon/network/mlp.h"
#include "recon/network/weight_norm.h"
#include "recon/surface/initial_surface.h"
#include "recon/surface/mucus_coat.h"
#include "recon/surface/volume.h"

namespace lumen {

// What the colour network's three outputs mean; see recon/surface/shading.h.
enum class Reflectance {
  kLambertian,  // log albedo of a wall whose shading is known: albedo/π · irradiance · cos
  kFree,        // log of BRDF · cos, a function of place, direction and normal: the paper's network
  kCoat,        // kLambertian's under a coat of mucus, whose numbers are learnt
  kUnlit,       // the pixel's own value, no light modelled: NeuS
};

// Whether the outputs are the log albedo of a wall that scatters light diffusely.
inline bool HasAlbedo(Reflectance reflectance) {
  return reflectance == Reflectance::kLambertian || reflectance == Reflectance::kCoat;
}

// What the wall receives from the rest of the wall.
enum class Interreflection {
  kNone,       // nothing: the paper's model
  kMean,       // π · the frame's mean radiance · exp(a smooth function of place that is learnt)
  kRadiosity,  // what the surface sends itself around the camera, by radiosity, · exp(the same)
};

struct FieldOptions {
  GridOptions grid;           // no levels: none
  int place_octaves = 0;      // of the frequency encoding of place
  int direction_octaves = 0;  // of the ray's direction, for networks that see it
  InitialSurfaceOptions initial;
  std::vector<int> sdf_hidden = {32};
  Activation sdf_activation = Activation::kSquareplus;
  int sdf_skip = 0;          // see MlpShape
  bool weight_norm = false;  // of the distance and the colour network
  // Of the factors of the networks' products, forward and backward; sums and what is learnt stay float.
  Precision network_precision = Precision::kFloat;
  std::vector<int> color_hidden = {32, 32};
  int features = 15;  // numbers that the distance network hands to the colour network
  double unit_mm = 68;
  Reflectance reflectance = Reflectance::kLambertian;
  // Of radiosity alone: albedo = sigmoid(output) rather than its exponential, beside one learnt factor of all
  // that is seen, the guides' power times the gain. Elsewhere an albedo has to have headroom for the light
  // between walls that isn't modelled.
  bool bound_albedo = true;
  MucusCoatOptions coat;                                          // of a kCoat wall
  Interreflection interreflection = Interreflection::kRadiosity;  // of a wall that HasAlbedo; others: none
  std::vector<int> ambient_hidden = {16};
};

template <class T>
class Field {
 public:
  // box: where the surface may lie, relative to the origin.
  Field(const FieldOptions& options, const InitialSurface& initial, const Eigen::AlignedBox3d& box);

  // Parameters: the grid's tables first, then the networks', the coat's last.
  size_t grid_size() const { return grid_.parameter_count(); }
  size_t network_size() const {
    return sdf_.parameter_count() + color_.parameter_count() + ambient_.parameter_count() + power_size() +
           coat_size();
  }
  size_t parameter_count() const { return grid_size() + network_size(); }
  const Grid<T>& grid() const { return grid_; }
  const Eigen::AlignedBox3d& box() const { return box_; }
  const FieldOptions& options() const { return options_; }
  void Initialise(uint64_t seed, T* parameters) const;
  // Between these parameters and what is learnt of them.
  WeightNorm<T> Normalisation() const;
  // Where the biases of the colour network's three outputs are.
  size_t color_bias_begin() const {
    return grid_size() + sdf_.parameter_count() + color_.parameter_count() - 3;
  }
  // Likewise of the ambient network's, if the field has_ambient.
  size_t ambient_bias_begin() const { return power_begin() - 3; }
  bool has_ambient() const { return ambient_.parameter_count() > 0; }
  bool bounds_albedo() const {
    return options_.bound_albedo && HasAlbedo(options_.reflectance) &&
           options_.interreflection == Interreflection::kRadiosity;
  }
  // Likewise of the power's logarithm, if the field bounds_albedo.
  size_t power_begin() const { return coat_begin() - power_size(); }
  // Log albedo of what the colour network puts out, where there is an albedo, with the derivative.
  T LogAlbedo(T output, T* slope = nullptr) const {
    if (slope) *slope = bounds_albedo() ? Sigmoid(-output) : T(1);
    return bounds_albedo() ? LogSigmoid(output) : output;
  }
  // And the output that has it: of albedos that a bounded one can't reach, the nearest that starts well.
  T OutputOfLogAlbedo(T log_albedo) const;
  // Likewise of the coat's numbers (LearntCoat), if the field has_coat.
  size_t coat_begin() const { return parameter_count() - coat_size(); }
  bool has_coat() const { return options_.reflectance == Reflectance::kCoat; }

  // Signed distances alone, of all tiles of positions.
  struct ValuePass {
    Panel<T> positions;  // in
    Panel<T> value;      // out: 1 row, mm
    Panel<T> input;      // between the passes
    typename Mlp<T>::Pass sdf;
  };
  void Value(const T* parameters, ValuePass* pass) const;

  // Signed distances, their gradient by place, and colour.
  struct SurfacePass {
    Panel<T> positions;       // in
    Panel<T> directions;      // in, 3 rows, of the rays; read by networks that see direction
    Panel<T> value;           // out: 1 row, mm
    Panel<T> gradient;        // out: 3 rows, ∂value/∂x, dimensionless
    Panel<T> free;            // out: 1 row, 1 = the network's own, 0 = cut off by the bounds: learns nothing
    Panel<T> value_delta;     // in, for the backward pass
    Panel<T> gradient_delta;  // in: ∂loss/∂gradient, 3 rows
    Panel<T> normal;          // in, before Color: unit normals, 3 rows
    Panel<T> color_delta;     // in: ∂loss/∂colour network's outputs, 3 rows
    Panel<T> ambient_delta;   // in, if the field has_ambient: ∂loss/∂ambient_output, 3 rows
    Panel<T> normal_delta;    // out of ColorBackward, 3 rows: 0 for networks that don't see the normal
    // Between the passes:
    Panel<T> input, jacobian, output_delta, direction, scaled_direction, input_delta, color_input,
        color_input_delta;
    Panel<T> ambient_input;
    typename Mlp<T>::Pass sdf, color, ambient;
    const Panel<T>& color_output() const { return color.value.back(); }
    // Log of the irradiance from the rest of the wall over that which its model gives before what is learnt
    // (see Interreflection); if the field has_ambient.
    const Panel<T>& ambient_output() const { return ambient.value.back(); }
  };
  void Surface(const T* parameters, SurfacePass* pass) const;
  void Color(const T* parameters, SurfacePass* pass) const;
  // In this order: ColorBackward, then SurfaceBackward.
  void ColorBackward(const T* parameters, SurfacePass* pass, T* network_gradient) const;
  void SurfaceBackward(const T* parameters, SurfacePass* pass, T* network_gradient) const;

  // Between ColorBackward and SurfaceBackward: ∂loss/∂positions, 3 rows, by way of the signed distances, the
  // features and the colour network's own look at place. Left out: that normals change with place, which on
  // a grid they do from cell to cell and not within (RayLoss compares those of neighbouring places), and the
  // ambient network, which is smooth. unused_gradient: room for the networks' parameters.
  void PositionsBackward(const T* parameters, SurfacePass* pass, T* unused_gradient,
                         Panel<T>* positions_delta) const;

  // What the backward pass leaves for the grid. Reuse it: it keeps its memory.
  struct GridTrace {
    int count = 0;       // samples
    Panel<T> positions;  // 3 rows
    Panel<T> delta;      // ∂loss/∂input of the distance network
    Panel<T> pull;       // ∂its first output/∂input
    Panel<T> direction;  // 3 rows, ∂loss/∂gradient · unit
  };
  // After SurfaceBackward: of the pass's first `count` samples. Takes the pass's panels for it and gives it
  // the trace's earlier ones to reuse.
  void LeaveForGrid(SurfacePass* pass, int count, GridTrace* trace) const;
  // Adds what a trace holds for one level.
  void GridBackward(int level, const GridTrace& trace, T* grid_gradient) const;

 private:
  void FillOutputDelta(SurfacePass* pass) const;
  bool sees_view() const { return !HasAlbedo(options_.reflectance); }
  size_t power_size() const { return bounds_albedo() ? 1 : 0; }
  size_t coat_size() const { return has_coat() ? static_cast<size_t>(CoatParameters(options_.coat)) : 0; }
  // Rows of the distance network's input before the three of place.
  int encoded() const { return grid_.outputs() + place_frequency_.outputs(); }
  // The base that the network's output is added to, and its gradient unless null.
  void StartFromInitial(const T* positions, T* value, T* gradient) const;
  void FillInput(const T* parameters, const Panel<T>& positions, Panel<T>* jacobian, Panel<T>* input) const;
  void CutOff(const Panel<T>& positions, Panel<T>* value, Panel<T>* gradient, Panel<T>* free) const;

  FieldOptions options_;
  InitialSurface initial_;
  Eigen::AlignedBox3d box_;
  Grid<T> grid_;
  Frequency<T> place_frequency_, direction_frequency_;
  Mlp<T> sdf_;
  Mlp<T> color_;
  Mlp<T> ambient_;  // of place alone: what comes from all over the lumen is smooth
  T unit_;
};

}  // namespace lumen
