// Where rays meet the surface as it is learnt so far, and what the field says of it there: for those who look
// at it, rather than learn.
#pragma once

#include <cstdint>

#include "recon/surface/field.h"
#include "recon/training/options.h"
#include "recon/training/ray_loss.h"

namespace lumen {

// Where the batch's rays meet the surface, to a hundredth of a mm: places samples as `sampling` and `key`
// say, of which each ray's last lies there. Their positions, 3 × rays.
Panel<float> MeetSurface(const Field<float>& field, const float* parameters,
                         const TrainOptions::Sampling& sampling, uint64_t key, RayBatch<float>* batch);

// Of as many places as there are rays.
struct SurfaceMet {
  Panel<float> positions;  // 3 rows: MeetSurface's
  Panel<float> gradient;   // 3 rows, of the signed distance
  Panel<float> free;       // 1 row, 0 where the field's bounds cut it off
  Panel<float> color;      // 3 rows, the colour network's outputs
};
// A few tiles at a time, so that of a wide network, too, little more than the answer is held at once.
SurfaceMet LookAtSurface(const Field<float>& field, const float* parameters,
                         const TrainOptions::Sampling& sampling, uint64_t key, RayBatch<float>* batch);

}  // namespace lumen
