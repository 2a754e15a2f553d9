// How a run's 300 MB are shared out. Nothing here depends on how many threads there are, for a run's bytes
// don't.
#pragma once

#include <cstddef>

#include "recon/training/options.h"

namespace lumen {

// Rays of a step that are computed by one thread. The pulls on albedo and ambient factor take their means
// over them, or over a piece.
inline constexpr int kChunkRays = 32;

// Rays that a thread computes at once: a piece of a chunk. With a grid, to which a chunk's batch goes back as
// one, all of it.
int RaysAtOnce(const TrainOptions& options);

// About what learning with the field's networks takes on two threads, bytes: parameters, their moments and
// gradients, and what the networks' passes leave for each other.
size_t NetworkBytes(const TrainOptions& options);

// What the frames' pixels may take up at most with the sequence's mask, bytes. 20 frames of 1350×1080 fit in
// whole. Of more or larger ones a part of the pixels is kept, the same of every frame and spread evenly: a
// run of 9,000 iterations looks at 2.3 million rays in all, and even 700 frames keep 40 million pixels. While
// frames are read, row by row, a megabyte of rows comes on top and a bit a pixel of the image.
inline constexpr size_t kFrameBytes = 124'000'000;

// And in a run with these options: less where networks are wide, but a quarter of it whatever these take.
size_t FrameBytes(const TrainOptions& options);

}  // namespace lumen
