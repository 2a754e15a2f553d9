// From rays and the places of their samples to the loss and its gradient: signed distances, opacities,
// shading, compositing, comparison with the pixels, and all the way back. The places are given
// (recon/training/march.h), so that the loss is a smooth function of the parameters, which is what its
// gradient is checked against.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "recon/surface/field.h"
#include "recon/surface/mucus_coat.h"
#include "recon/surface/shading.h"
#include "recon/training/loss.h"
#include "recon/training/phase_clock.h"

namespace lumen {

// A gradient this large counts as not finite. Adam squares gradients: beyond 1e19 a float's square is
// infinite, and the moment that holds it, and the parameter with it, would stand still for ever. An entry of
// the grid gets products of two of the numbers that are looked at, over a cell of 1e-3 mm at the least:
// (1e8)² · 1e3. A loss of about 1 has gradients of about 1.
inline constexpr double kLargestGradient = 1e8;

// Some rays with what their pixels show.
template <class T>
struct RayBatch {
  struct Ray {
    Vec3<T> origin, direction;  // mm, relative to the field's origin; unit
    int frame;                  // index into the lights and gains
    // Predicted radiance × exposure is comparable with the observed one: gain · vignetting over the pixel's
    // own normalisation (L_e g of the paper).
    T exposure;
    T floor;           // of Compress, in the same normalised units
    Vec3<T> observed;  // normalised and compressed: the paper's I′
    std::array<PixelBound, 3> bound;
    int eikonal_sample;  // one sample a ray that the eikonal term sees wherever it lies
  };
  std::vector<Ray> rays;
  uint64_t first = 0;       // the first ray's number among those whose random numbers have one key
  int samples = 0;          // a ray
  std::vector<T> distance;  // rays × samples, increasing, mm
};

template <class T>
struct LossSettings {
  T sharpness;      // s, 1/mm
  T inverse_gamma;  // of the comparison
  T eikonal_weight;
  T albedo_weight;   // of the pull of the albedo to the batch's mean, where there is one
  T albedo_width;    // of its Huber loss, in log
  T ambient_weight;  // of the same pull on the log ambient factor
  T ambient_doubt;   // of ChannelTrust
  // Samples whose weight and whose influence on any weight are below this are left out; 0 = none.
  T weight_threshold;
  T per_ray;                     // 1/number of rays of the whole step
  bool linear_sections = false;  // weights are LinearRayWeights
};

// Sums over a batch; the first five are the parts of the step's loss.
struct LossTerms {
  double photometric = 0;
  double eikonal = 0;
  double albedo = 0;
  double ambient = 0;
  double free_space = 0;        // of the cameras, not of rays: recon/training/free_space.h
  double by_log_sharpness = 0;  // ∂loss/∂log s
  int64_t active_samples = 0;

  double Sum() const { return photometric + eikonal + albedo + ambient + free_space; }
  LossTerms& operator+=(const LossTerms& other);
};

// What a pose can move by: a translation, mm, and a rotation vector about the camera's place, rad, in the
// axes of the field.
inline constexpr int kPoseNumbers = 6;

// Computes on one batch at a time, reusing its memory.
template <class T>
class RayLoss {
 public:
  explicit RayLoss(const Field<T>* field) : field_(field) {}

  // Evaluate's phases are measured by it from then on; null: they aren't.
  void set_clock(PhaseClock* clock) { clock_ = clock; }

  // Loss of a batch. Adds the gradient by the networks' parameters to network_gradient and by each frame's
  // log gain to log_gain_gradient; the grid's part waits for LeaveForGrid. pose_gradient: null, or
  // kPoseNumbers a frame, to which is added the gradient by a motion of the frame's camera with its rays,
  // their samples and its lights. The ambient network stands still (Field::PositionsBackward).
  LossTerms Evaluate(const T* parameters, const RayBatch<T>& batch, const std::vector<FrameLight<T>>& lights,
                     const std::vector<T>& log_gain, const LossSettings<T>& settings, T* network_gradient,
                     T* log_gain_gradient, T* pose_gradient = nullptr);
  // What a place of the wall sends to the camera, without glints.
  struct Wall {
    Vec3<T> albedo, direct, indirect;
    bool beyond;  // the bounds, where nothing is learnt
  };
  // Of each ray's last sample, which lies on the surface (MeetSurface). The field must have an albedo.
  std::vector<Wall> LookAtLast(const T* parameters, const RayBatch<T>& batch,
                               const std::vector<FrameLight<T>>& lights, const std::vector<T>& log_gain);
  // After Evaluate: what its batch sends back to the grid (Field::GridBackward).
  void LeaveForGrid(typename Field<T>::GridTrace* trace) {
    field_->LeaveForGrid(&surface_, static_cast<int>(active_.size()), trace);
  }

 private:
  struct Active {
    int ray, sample;
    T weight;  // of the sample in its ray; 0 if only the eikonal term sees it
  };
  void FindWeights(const T* parameters, const RayBatch<T>& batch, const LossSettings<T>& settings);
  void SelectActive(const RayBatch<T>& batch, const LossSettings<T>& settings);
  void ShadeActive(const T* parameters, const RayBatch<T>& batch, const std::vector<FrameLight<T>>& lights,
                   const std::vector<T>& log_gain);
  double ComparePixels(const RayBatch<T>& batch, const std::vector<T>& log_gain,
                       const LossSettings<T>& settings, T* log_gain_gradient);
  double Pull(T strength, T width, const Panel<T>& output, Panel<T>* delta);
  void BoundAlbedo(const Panel<T>& output);
  void ScaleByPower(T power);
  void PowerBackward(T* network_gradient) const;
  void CoatBackward(const T* parameters, T* network_gradient) const;
  // ∂photometric loss/∂gradient of the SDF at an active sample.
  Vec3<T> ByGradient(size_t i) const;
  // pose_gradient.cpp.
  void AddPoseGradient(const T* parameters, const RayBatch<T>& batch, T* pose_gradient);
  void LookBeside(const T* parameters);
  void AddNormals(const T* parameters, const RayBatch<T>& batch, T* pose_gradient);
  void BackToSamples(const RayBatch<T>& batch, const LossSettings<T>& settings, LossTerms* terms);

  const Field<T>* field_;
  PhaseClock* clock_ = nullptr;
  typename Field<T>::ValuePass value_;
  typename Field<T>::SurfacePass surface_;
  // Rays × samples.
  std::vector<T> signed_distance_, occupancy_, transmittance_, near_share_, weight_, weight_delta_,
      distance_delta_;
  std::vector<Vec3<T>> ambient_;         // a ray: the part of its radiance that the rest of the wall sends
  std::vector<Vec3<T>> radiance_delta_;  // a ray
  std::vector<Active> active_;
  std::vector<T> length_;                    // an active sample: of the SDF's gradient
  std::vector<Shading<T>> shading_;          // an active sample
  std::vector<ByCoat<T>> by_coat_;           // likewise, if the field has_coat
  Panel<T> sample_weight_;                   // its weight; 0 beyond the last
  Panel<T> pull_, pull_slope_, pull_share_;  // on three of its outputs
  Panel<T> log_albedo_, log_albedo_slope_;   // of the colour network's outputs, if the field bounds_albedo
  // Of the gradient by poses:
  Panel<T> positions_delta_;
  LineVector<T> unused_gradient_;
  std::vector<Vec3<T>> by_gradient_;       // a ray: ByGradient, summed over its samples
  std::vector<int> heaviest_;              // a ray: its active sample of the largest weight, or −1
  typename Field<T>::SurfacePass beside_;  // on either side of it
};

}  // namespace lumen
