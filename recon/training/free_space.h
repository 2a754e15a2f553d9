// Where a camera stands is lumen, whatever the pixels say: the loss of cameras that the wall closes over.
// Rays that start within the wall leave it by its back unseen, so that without this nothing would bring back
// a camera that a step has put there.
#pragma once

#include <vector>

#include "recon/surface/field.h"

namespace lumen {

template <class T>
class FreeSpace {
 public:
  explicit FreeSpace(const Field<T>* field) : field_(field) {}

  // Loss: weight · the mean over the places (relative to the field's origin, at least one) of how much the
  // signed distance there falls short of clearance_mm. Adds its gradient by the networks' parameters to
  // network_gradient; the grid's part waits for GridBackward. Where no place falls short that is nothing, and
  // costs one look at the distances.
  T Evaluate(const T* parameters, const std::vector<Vec3<T>>& places, T clearance_mm, T weight,
             T* network_gradient);
  // After Evaluate; for one level of the grid.
  void GridBackward(int level, T* grid_gradient) const;

 private:
  const Field<T>* field_;
  typename Field<T>::ValuePass value_;
  typename Field<T>::SurfacePass surface_;
  typename Field<T>::GridTrace trace_;  // of the places that fall short
};

}  // namespace lumen
