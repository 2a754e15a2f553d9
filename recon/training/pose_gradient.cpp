// The gradient of RayLoss by motions of the cameras.
#include "recon/training/ray_loss.h"

namespace lumen {
namespace {

// How far apart normals are compared, mm, to either side. A grid's normals change from cell to cell, by
// steps, and hardly within: a difference over some part of a cell sees the steps at the rate at which they
// come, where a derivative would miss them all. The finest cells of the default are about twice as large.
constexpr double kBeside = 0.5;

// What the motion of a sample with its camera adds: by_place itself, and the turn by the lever of it.
template <class T>
void AddMotion(const Vec3<T>& by_place, const Vec3<T>& from_camera, T* sum) {
  const Vec3<T> by_rotation = from_camera.cross(by_place);
  for (int d = 0; d < 3; ++d) {
    sum[d] += by_place[d];
    sum[3 + d] += by_rotation[d];
  }
}

}  // namespace

// Samples keep their places in the camera's axes, and so does the light that comes to them.
template <class T>
void RayLoss<T>::AddPoseGradient(const T* parameters, const RayBatch<T>& batch, T* pose_gradient) {
  unused_gradient_.assign(field_->network_size(), T(0));
  field_->PositionsBackward(parameters, &surface_, unused_gradient_.data(), &positions_delta_);
  for (size_t i = 0; i < active_.size(); ++i) {
    const auto& ray = batch.rays[active_[i].ray];
    const T distance = batch.distance[size_t(active_[i].ray) * batch.samples + active_[i].sample];
    const Vec3<T> by_place(positions_delta_.At(0, i), positions_delta_.At(1, i), positions_delta_.At(2, i));
    AddMotion<T>(by_place, distance * ray.direction, pose_gradient + ray.frame * kPoseNumbers);
  }
  AddNormals(parameters, batch, pose_gradient);
}

// Gathers by_gradient_ and heaviest_, and the SDF's gradients to either side of these samples, along
// by_gradient_: what is asked for is the SDF's Hessian times by_gradient_, the change of its gradient that
// way.
template <class T>
void RayLoss<T>::LookBeside(const T* parameters) {
  for (size_t i = 0; i < active_.size(); ++i) {
    const Active& sample = active_[i];
    by_gradient_[sample.ray] += ByGradient(i);
    int& heaviest = heaviest_[sample.ray];
    if (sample.weight > 0 && (heaviest < 0 || sample.weight > active_[heaviest].weight))
      heaviest = static_cast<int>(i);
  }
  const int rays = static_cast<int>(heaviest_.size());
  beside_.positions.Resize(3, TilesFor(2 * rays));
  beside_.positions.SetZero();
  for (int r = 0; r < rays; ++r) {
    const T size = by_gradient_[r].norm();
    if (!(size > 0)) continue;
    for (int d = 0; d < 3; ++d) {
      const T aside = T(kBeside) * by_gradient_[r][d] / size;
      beside_.positions.At(d, 2 * r) = surface_.positions.At(d, heaviest_[r]) - aside;
      beside_.positions.At(d, 2 * r + 1) = surface_.positions.At(d, heaviest_[r]) + aside;
    }
  }
  field_->Surface(parameters, &beside_);
}

// That other places have other normals, and that the light turns against them. Close to the wall, where the
// samples are that count, a ray's have one normal: the heaviest stands for all.
template <class T>
void RayLoss<T>::AddNormals(const T* parameters, const RayBatch<T>& batch, T* pose_gradient) {
  by_gradient_.assign(batch.rays.size(), Vec3<T>::Zero());
  heaviest_.assign(batch.rays.size(), -1);
  LookBeside(parameters);
  for (size_t r = 0; r < batch.rays.size(); ++r) {
    const T size = by_gradient_[r].norm();
    if (!(size > 0)) continue;
    Vec3<T> by_place, gradient;
    for (int d = 0; d < 3; ++d) {
      const int at = static_cast<int>(2 * r);
      by_place[d] = size * (beside_.gradient.At(d, at + 1) - beside_.gradient.At(d, at)) / T(2 * kBeside);
      gradient[d] = surface_.gradient.At(d, heaviest_[r]);
    }
    const auto& ray = batch.rays[r];
    T* sum = pose_gradient + ray.frame * kPoseNumbers;
    const T distance = batch.distance[r * size_t(batch.samples) + active_[heaviest_[r]].sample];
    AddMotion<T>(by_place, distance * ray.direction, sum);
    // Networks that see the normal see it in the world's axes, whatever the light does.
    if (!HasAlbedo(field_->options().reflectance)) continue;
    // In the camera's axes the wall's gradient turns the other way: u · (−ω × g) = ω · (u × g).
    const Vec3<T> turned = by_gradient_[r].cross(gradient);
    for (int d = 0; d < 3; ++d) sum[3 + d] += turned[d];
  }
}

template void RayLoss<float>::AddPoseGradient(const float*, const RayBatch<float>&, float*);
template void RayLoss<double>::AddPoseGradient(const double*, const RayBatch<double>&, double*);

}  // namespace lumen
