// A tile of a frame's pixels, whose samples are traced together.
#pragma once

#include <cstdint>

#include "common/camera.h"
#include "common/image.h"
#include "common/lanes.h"
#include "sim/imaging/guide_light.h"
#include "sim/imaging/places.h"

namespace lumen {

// A tile is kBlocks blocks of kBlockEdge × kBlockEdge pixels, a block one packet of rays.
inline constexpr int kBlockEdge = 4, kBlocksAcross = 4, kBlocks = kBlocksAcross * kBlocksAcross;
inline constexpr int kTileEdge = kBlockEdge * kBlocksAcross;
static_assert(kBlockEdge * kBlockEdge == kLanes);

// The tiles that cover a frame, in rows. The first may begin beyond its corner.
struct TileGrid {
  TileGrid(int width, int height, int shift_x, int shift_y)
      : shift_x(shift_x),
        shift_y(shift_y),
        columns((width + shift_x + kTileEdge - 1) / kTileEdge),
        rows((height + shift_y + kTileEdge - 1) / kTileEdge) {}

  int shift_x, shift_y, columns, rows;

  int Of(int x, int y) const { return (y + shift_y) / kTileEdge * columns + (x + shift_x) / kTileEdge; }
};

// One sample of each of a tile's pixels.
template <bool kCoat>
struct TileSample {
  PlacesOf<kCoat> places[kBlocks];  // that the pixels see
  Lanes3 indirect[kBlocks];
  Lanes3 mirrored[kBlocks];  // indirect light off the coat, apart from the rest where there is tissue
};

// Where a tile lies. The tile may reach beyond the image.
struct TilePixels {
  int x0, y0;
  LanesI on[kBlocks];            // −1: a pixel that is rendered
  Lanes x[kBlocks], y[kBlocks];  // of the pixels' centres

  int X(int block, int lane) const { return x0 + block % kBlocksAcross * kBlockEdge + lane % kBlockEdge; }
  int Y(int block, int lane) const { return y0 + block / kBlocksAcross * kBlockEdge + lane / kBlockEdge; }

  // on: the pixels of `valid` that aren't 0.
  TilePixels(int x0, int y0, const Image8& valid) : x0(x0), y0(y0) {
    for (int block = 0; block < kBlocks; ++block) {
      for (int i = 0; i < kLanes; ++i) {
        const int column = X(block, i), row = Y(block, i);
        const bool inside = column >= 0 && row >= 0 && column < valid.width && row < valid.height;
        on[block][i] = inside && *valid.Pixel(column, row) != 0 ? -1 : 0;
        x[block][i] = static_cast<float>(column);
        y[block][i] = static_cast<float>(row);
      }
    }
  }
  bool Empty() const {
    LanesI any{};
    for (const LanesI& block : on) any |= block;
    return !Any(any);
  }
};

}  // namespace lumen
