// Sixteen numbers at a time, in the compiler's own vector types: what the hot loops over packets of rays are
// written in. Operators work lane by lane; a comparison gives −1 (yes) or 0 in each lane of a LanesI, and
// `mask ? a : b` chooses lane by lane. On AVX-512 each is one register, elsewhere the compiler splits them.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "common/math.h"

#ifdef __AVX512F__
#include <immintrin.h>
#endif

namespace lumen {

inline constexpr int kLanes = 16;
using Lanes = float __attribute__((vector_size(64)));
using LanesI = int32_t __attribute__((vector_size(64)));
using LanesU = uint32_t __attribute__((vector_size(64)));

struct Lanes3 {
  Lanes x, y, z;
  Vec3f operator[](int lane) const { return {x[lane], y[lane], z[lane]}; }
  void Set(int lane, const Vec3f& value) {
    x[lane] = value[0];
    y[lane] = value[1];
    z[lane] = value[2];
  }
};

inline Lanes Broadcast(float value) { return Lanes{} + value; }
inline LanesI BroadcastI(int32_t value) { return LanesI{} + value; }
inline LanesU BroadcastU(uint32_t value) { return LanesU{} + value; }
inline Lanes3 Broadcast(const Vec3f& v) { return {Broadcast(v[0]), Broadcast(v[1]), Broadcast(v[2])}; }

inline Lanes Load(const float* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}
inline void Store(const Lanes& lanes, float* to) { std::memcpy(to, &lanes, sizeof(lanes)); }
inline LanesI LoadI(const uint32_t* from) {
  LanesI lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}
inline Lanes3 Load3(const float (*from)[kLanes]) { return {Load(from[0]), Load(from[1]), Load(from[2])}; }
inline void Store3(const Lanes3& lanes, float (*to)[kLanes]) {
  Store(lanes.x, to[0]);
  Store(lanes.y, to[1]);
  Store(lanes.z, to[2]);
}

inline Lanes ToFloat(const LanesI& lanes) { return __builtin_convertvector(lanes, Lanes); }
// Towards zero; what no int32_t holds is undefined.
inline LanesI Truncate(const Lanes& lanes) { return __builtin_convertvector(lanes, LanesI); }
// The largest integer not above, for numbers within int32_t.
inline LanesI FloorInt(const Lanes& lanes) {
  const LanesI cut = Truncate(lanes);
  return cut + (ToFloat(cut) > lanes);  // a mask is −1 where it holds
}

// The second operand where either is not a number.
inline Lanes Min(const Lanes& a, const Lanes& b) { return a < b ? a : b; }
inline Lanes Max(const Lanes& a, const Lanes& b) { return a > b ? a : b; }
inline Lanes Abs(const Lanes& a) { return (Lanes)((LanesI)a & 0x7fffffff); }

inline Lanes Sqrt(const Lanes& a) {
#ifdef __AVX512F__
  return (Lanes)_mm512_maskz_sqrt_ps(0xffff, (__m512)a);
#else
  Lanes root;
  for (int i = 0; i < kLanes; ++i) root[i] = std::sqrt(a[i]);
  return root;
#endif
}

inline bool Any(const LanesI& mask) {
#ifdef __AVX512F__
  return _mm512_test_epi32_mask((__m512i)mask, (__m512i)mask) != 0;
#else
  int32_t any = 0;
  for (int i = 0; i < kLanes; ++i) any |= mask[i];
  return any != 0;
#endif
}

// How many lanes a mask holds in.
inline int Count(const LanesI& mask) {
#ifdef __AVX512F__
  return __builtin_popcount(_mm512_test_epi32_mask((__m512i)mask, (__m512i)mask));
#else
  int32_t count = 0;
  for (int i = 0; i < kLanes; ++i) count -= mask[i];
  return count;
#endif
}

// table[index] in each lane.
inline Lanes Gather(const float* table, const LanesI& index) {
#ifdef __AVX512F__
  return (Lanes)_mm512_mask_i32gather_ps(__m512{}, 0xffff, (__m512i)index, table, sizeof(float));
#else
  Lanes gathered;
  for (int i = 0; i < kLanes; ++i) gathered[i] = table[index[i]];
  return gathered;
#endif
}

inline LanesI Gather(const int32_t* table, const LanesI& index) {
#ifdef __AVX512F__
  return (LanesI)_mm512_mask_i32gather_epi32(__m512i{}, 0xffff, (__m512i)index, table, sizeof(int32_t));
#else
  LanesI gathered;
  for (int i = 0; i < kLanes; ++i) gathered[i] = table[index[i]];
  return gathered;
#endif
}

// eˣ, to 2 units in the last place; 0 below −87 (e^−87 is the last that is a normal number), e^88 above 88.
// Cody and Waite's reduction by ln 2 in two parts, then Cephes's polynomial of degree 7 (Moshier, expf).
inline Lanes Exp(const Lanes& x) {
  constexpr float kLowest = -87, kHighest = 88;
  const Lanes bounded = Min(Max(x, Broadcast(kLowest)), Broadcast(kHighest));
  const Lanes scaled = bounded * 1.44269504f;
  const LanesI power = Truncate(scaled + (scaled < 0 ? Broadcast(-0.5f) : Broadcast(0.5f)));
  const Lanes whole = ToFloat(power);
  const Lanes r = (bounded - whole * 0.693359375f) - whole * -2.12194440e-4f;
  Lanes p = r * 1.9875691500e-4f + 1.3981999507e-3f;
  p = p * r + 8.3334519073e-3f;
  p = p * r + 4.1665795894e-2f;
  p = p * r + 1.6666665459e-1f;
  p = p * r + 5.0000001201e-1f;
  const Lanes fraction = p * r * r + r + 1.0f;
  const Lanes result = (Lanes)((LanesI)fraction + (power << 23));
  const Lanes above = x < kLowest ? Lanes{} : result;
  return x != x ? x : above;
}

inline Lanes Dot(const Lanes3& a, const Lanes3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Lanes3 operator+(const Lanes3& a, const Lanes3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Lanes3 operator-(const Lanes3& a, const Lanes3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Lanes3 operator*(const Lanes3& a, const Lanes& b) { return {a.x * b, a.y * b, a.z * b}; }
inline Lanes3 operator*(const Lanes3& a, const Lanes3& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline Lanes3 Select(const LanesI& mask, const Lanes3& a, const Lanes3& b) {
  return {mask ? a.x : b.x, mask ? a.y : b.y, mask ? a.z : b.z};
}
inline Lanes3 Max(const Lanes3& a, const Lanes3& b) { return {Max(a.x, b.x), Max(a.y, b.y), Max(a.z, b.z)}; }
inline Lanes3 Cross(const Lanes3& a, const Lanes3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Lanes3 Normalized(const Lanes3& a) { return a * (1.0f / Sqrt(Dot(a, a))); }
inline Lanes Sum(const Lanes3& a) { return a.x + a.y + a.z; }
inline Lanes MaxOf(const Lanes3& a) { return Max(a.x, Max(a.y, a.z)); }
inline LanesI IsFinite(const Lanes& a) {
  return Abs(a) <= 3.402823466e38f;  // FLT_MAX
}

}  // namespace lumen
