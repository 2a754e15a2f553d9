#include "recon/training/free_space.h"

#include <algorithm>

namespace lumen {

template <class T>
T FreeSpace<T>::Evaluate(const T* parameters, const std::vector<Vec3<T>>& places, T clearance_mm, T weight,
                         T* network_gradient) {
  const int count = static_cast<int>(places.size());
  value_.positions.Resize(3, TilesFor(count));
  for (int i = 0; i < value_.positions.tiles() * kTile; ++i) {
    for (int d = 0; d < 3; ++d) value_.positions.At(d, i) = places[std::min(i, count - 1)][d];
  }
  field_->Value(parameters, &value_);
  T loss = 0;
  std::vector<int> indices;
  for (int i = 0; i < count; ++i) {
    const T missing = clearance_mm - value_.value.At(0, i);
    if (!(missing > 0)) continue;
    loss += weight / T(count) * missing;
    indices.push_back(i);
  }
  const int missed = static_cast<int>(indices.size());
  trace_.count = 0;
  if (missed == 0) return 0;

  const int tiles = TilesFor(missed);
  surface_.positions.Resize(3, tiles);
  for (int i = 0; i < tiles * kTile; ++i) {
    const int place = indices[std::min(i, missed - 1)];
    for (int d = 0; d < 3; ++d) surface_.positions.At(d, i) = places[place][d];
  }
  field_->Surface(parameters, &surface_);
  surface_.value_delta.Resize(1, tiles);
  surface_.gradient_delta.Resize(3, tiles);
  surface_.color_input_delta.Resize(field_->options().features, tiles);
  surface_.value_delta.SetZero();
  surface_.gradient_delta.SetZero();
  surface_.color_input_delta.SetZero();
  for (int i = 0; i < missed; ++i) surface_.value_delta.At(0, i) = -weight / T(count);
  field_->SurfaceBackward(parameters, &surface_, network_gradient);
  field_->LeaveForGrid(&surface_, missed, &trace_);
  return loss;
}

template <class T>
void FreeSpace<T>::GridBackward(int level, T* grid_gradient) const {
  if (trace_.count > 0) field_->GridBackward(level, trace_, grid_gradient);
}

template class FreeSpace<float>;
template class FreeSpace<double>;

}  // namespace lumen
