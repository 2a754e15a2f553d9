// C3VD's encodings of depth, normals and flow in 16 bits (Bobrow et al., "Colonoscopy 3D video dataset with
// paired depth from 2D-3D registration", Medical Image Analysis 90, 2023).
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "common/sequence.h"

namespace lumen {
namespace {

constexpr double kFullScale = 65535;
constexpr double kDepthRange_mm = 100;
constexpr double kFlowRange_px = 20;
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

void RequireChannels(int channels, int expected) {
  if (channels < expected) throw std::logic_error("an image of fewer channels than its encoding has");
}

// The value in [0, 1] as one of 65536 steps, to the nearest.
uint16_t Step(double fraction) {
  return static_cast<uint16_t>(std::lround(std::clamp(fraction, 0.0, 1.0) * kFullScale));
}

}  // namespace

Image16 EncodeDepth(const ImageF& z_mm) {
  RequireChannels(z_mm.channels, 1);
  Image16 encoded(z_mm.width, z_mm.height, 1);
  for (size_t i = 0; i < encoded.data.size(); ++i) {
    const double z = z_mm.data[i * z_mm.channels];
    // NaN, and what lies beside or behind a wide-angle camera, isn't above 0.
    if (z > 0)
      encoded.data[i] =
          static_cast<uint16_t>(std::min(std::floor(kFullScale * z / kDepthRange_mm), kFullScale));
  }
  return encoded;
}

ImageF DecodeDepth(const Image16& encoded) {
  RequireChannels(encoded.channels, 1);
  ImageF z_mm(encoded.width, encoded.height, 1, kNothing);
  for (size_t i = 0; i < z_mm.data.size(); ++i) {
    const uint16_t step = encoded.data[i * encoded.channels];
    if (step == kFullScale) {
      z_mm.data[i] = std::numeric_limits<float>::infinity();
    } else if (step > 0) {
      z_mm.data[i] = static_cast<float>((step + 0.5) * kDepthRange_mm / kFullScale);
    }
  }
  return z_mm;
}

Image16 EncodeNormals(const ImageF& normal) {
  RequireChannels(normal.channels, 3);
  Image16 encoded(normal.width, normal.height, 3);
  for (int y = 0; y < normal.height; ++y) {
    for (int x = 0; x < normal.width; ++x) {
      const float* n = normal.Pixel(x, y);
      if (std::isnan(n[0]) || std::isnan(n[1]) || std::isnan(n[2])) continue;
      for (int c = 0; c < 3; ++c) encoded.Pixel(x, y)[c] = Step((n[c] + 1.0) / 2);
    }
  }
  return encoded;
}

ImageF DecodeNormals(const Image16& encoded) {
  RequireChannels(encoded.channels, 3);
  ImageF normal(encoded.width, encoded.height, 3, kNothing);
  for (int y = 0; y < encoded.height; ++y) {
    for (int x = 0; x < encoded.width; ++x) {
      const uint16_t* v = encoded.Pixel(x, y);
      // (−1, −1, −1) is no unit vector: nothing.
      if (v[0] == 0 && v[1] == 0 && v[2] == 0) continue;
      for (int c = 0; c < 3; ++c) normal.Pixel(x, y)[c] = static_cast<float>(v[c] / kFullScale * 2 - 1);
    }
  }
  return normal;
}

Image16 EncodeFlow(const ImageF& flow_px) {
  RequireChannels(flow_px.channels, 2);
  Image16 encoded(flow_px.width, flow_px.height, 3);
  for (int y = 0; y < flow_px.height; ++y) {
    for (int x = 0; x < flow_px.width; ++x) {
      const float* flow = flow_px.Pixel(x, y);
      if (std::isnan(flow[0]) || std::isnan(flow[1])) continue;
      for (int c = 0; c < 2; ++c)
        encoded.Pixel(x, y)[c] = Step((flow[c] + kFlowRange_px) / (2 * kFlowRange_px));
    }
  }
  return encoded;
}

ImageF DecodeFlow(const Image16& encoded) {
  RequireChannels(encoded.channels, 2);
  ImageF flow_px(encoded.width, encoded.height, 2, kNothing);
  for (int y = 0; y < encoded.height; ++y) {
    for (int x = 0; x < encoded.width; ++x) {
      const uint16_t* v = encoded.Pixel(x, y);
      if (v[0] == 0 && v[1] == 0) continue;
      for (int c = 0; c < 2; ++c) {
        flow_px.Pixel(x, y)[c] = static_cast<float>(v[c] / kFullScale * (2 * kFlowRange_px) - kFlowRange_px);
      }
    }
  }
  return flow_px;
}

}  // namespace lumen
