#include "recon/surface/volume.h"

#include <algorithm>

namespace lumen {
namespace {

// Φ(x) = 1/(1 + e^−x) and its logarithm, by one exponential.
template <class T>
struct Opening {
  explicit Opening(T at) : x(at), e(std::exp(-std::abs(at))), log1p_e(std::log1p(e)) {}
  T Log() const { return x >= 0 ? -log1p_e : x - log1p_e; }
  T Open() const { return (x >= 0 ? T(1) : e) / (1 + e); }
  T Occupancy() const { return (x > 0 ? e : T(1)) / (1 + e); }

  T x, e, log1p_e;
};

// In units of 1/s. A thinner section's near share is taken from a series about its middle, whose next term is
// Δ³/720 of what the section takes, 1e-5; of the closed form's terms only Δ²/8 remains there, so that their
// rounding, too, is 1e-5 of it.
constexpr double kThinSection = 0.2;

// Where Φ(x) is e^x to a float's last bit.
constexpr double kDeep = -16;

// log_ratio, drop: log Φ(to)/Φ(from) ≤ 0 and 1 − Φ(to)/Φ(from).
template <class T>
T NearShare(const Opening<T>& from, const Opening<T>& to, T log_ratio, T drop) {
  const T thickness = from.x - to.x;
  T share;
  if (thickness < T(kThinSection)) {
    share = drop * (T(0.5) + thickness * (1 - from.Open() - to.Open()) / 12);
  } else if (from.x >= 0) {
    share = (-log_ratio - thickness * from.Occupancy()) / (thickness * from.Open());
  } else if (from.x > T(kDeep)) {
    share = 1 - (from.log1p_e - to.log1p_e) / (thickness * from.Open());
  } else {
    share = 1 + std::expm1(-thickness) / thickness;
  }
  return std::clamp(share, T(0), drop);  // the mean of what falls lies between its ends; rounding may not
}

}  // namespace

template <class T>
void RayWeights(int n, const T* signed_distance, T sharpness, T* occupancy, T* transmittance, T* weight) {
  const auto log_open = [&](int i) {
    const Opening<T> opening(sharpness * signed_distance[i]);
    occupancy[i] = opening.Occupancy();
    return opening.Log();
  };
  T log_here = log_open(0);
  transmittance[0] = 1;
  weight[0] = 0;
  for (int i = 0; i + 1 < n; ++i) {
    const T log_next = log_open(i + 1);
    const T change = log_next < log_here ? log_next - log_here : T(0);
    const T section = -transmittance[i] * std::expm1(change);
    transmittance[i + 1] = transmittance[i] - section;
    weight[i] += section / 2;
    weight[i + 1] = section / 2;
    log_here = log_next;
  }
  weight[n - 1] += transmittance[n - 1];
}

template <class T>
void RayWeightsBackward(int n, const T* signed_distance, T sharpness, const T* occupancy,
                        const T* transmittance, const T* weight_delta, T* distance_delta) {
  // With w_i a section's weight and ℓ_i its logarithm: ∂w_i/∂ℓ_i = −transmittance behind it, ∂w_i/∂ℓ_j = w_i
  // for the sections j before it. dlogΦ(y)/dy = Φ(−y).
  T behind = transmittance[n - 1] * weight_delta[n - 1];  // Σ over the sections behind of weight · delta
  T from_next = 0;                                        // ∂loss/∂ℓ of the section after sample i
  for (int i = n - 1; i >= 0; --i) {
    T from_previous = 0;
    if (i > 0) {
      const T delta = (weight_delta[i - 1] + weight_delta[i]) / 2;
      if (signed_distance[i] < signed_distance[i - 1]) from_previous = behind - transmittance[i] * delta;
      behind += (transmittance[i - 1] - transmittance[i]) * delta;
    }
    distance_delta[i] = sharpness * occupancy[i] * (from_previous - from_next);
    from_next = from_previous;
  }
}

template <class T>
void LinearRayWeights(int n, const T* signed_distance, T sharpness, T* occupancy, T* transmittance,
                      T* near_share, T* weight) {
  Opening<T> here(sharpness * signed_distance[0]);
  occupancy[0] = here.Occupancy();
  transmittance[0] = 1;
  weight[0] = 0;
  for (int i = 0; i + 1 < n; ++i) {
    const Opening<T> next(sharpness * signed_distance[i + 1]);
    occupancy[i + 1] = next.Occupancy();
    const T change = std::min(T(0), next.Log() - here.Log());
    const T drop = -std::expm1(change);
    near_share[i] = next.x < here.x ? NearShare(here, next, change, drop) : T(0);
    transmittance[i + 1] = transmittance[i] - transmittance[i] * drop;
    weight[i] += transmittance[i] * near_share[i];
    weight[i + 1] = transmittance[i] * (drop - near_share[i]);
    here = next;
  }
  near_share[n - 1] = 1;
  weight[n - 1] += transmittance[n - 1];
}

template <class T>
void LinearRayWeightsBackward(int n, const T* signed_distance, T sharpness, const T* occupancy,
                              const T* transmittance, const T* near_share, const T* weight_delta,
                              T* distance_delta) {
  // With x = s·f at a section's ends, r = Φ(x₁)/Φ(x₀), g its near share, Δ = x₀ − x₁: ∂log r/∂x₀ = −Φ(−x₀),
  // ∂log r/∂x₁ = Φ(−x₁); ∂g/∂x₀ = (1 − g)·Φ(−x₀) − g/Δ, ∂g/∂x₁ = −(1 − r − g)/Δ, or those of the series.
  T behind = transmittance[n - 1] * weight_delta[n - 1];  // Σ over the sections behind of weight · delta
  std::fill_n(distance_delta, n, T(0));
  for (int i = n - 2; i >= 0; --i) {
    const T here = transmittance[i], rest = transmittance[i + 1], g = near_share[i];
    const T near = here * g, far = here - rest - near;
    const T thickness = sharpness * signed_distance[i] - sharpness * signed_distance[i + 1];
    if (thickness > 0 && here > 0) {
      const T o0 = occupancy[i], o1 = occupancy[i + 1], r = rest / here;
      const T by_log_ratio = behind - rest * weight_delta[i + 1];
      const T by_share = here * (weight_delta[i] - weight_delta[i + 1]);
      T from, to;
      if (thickness < T(kThinSection)) {
        const T tilt = (o0 + o1 - 1) / 12, half = T(0.5) + thickness * tilt;
        from = r * o0 * half + (1 - r) * (tilt - thickness * (1 - o0) * o0 / 12);
        to = -r * o1 * half - (1 - r) * (tilt + thickness * (1 - o1) * o1 / 12);
      } else {
        from = (1 - g) * o0 - g / thickness;
        to = -(1 - r - g) / thickness;
      }
      distance_delta[i] += sharpness * (by_share * from - by_log_ratio * o0);
      distance_delta[i + 1] += sharpness * (by_share * to + by_log_ratio * o1);
    }
    behind += near * weight_delta[i] + far * weight_delta[i + 1];
  }
}

#define LUMEN_INSTANTIATE(T)                                                                               \
  template void LinearRayWeights<T>(int, const T*, T, T*, T*, T*, T*);                                     \
  template void LinearRayWeightsBackward<T>(int, const T*, T, const T*, const T*, const T*, const T*, T*); \
  template void RayWeights<T>(int, const T*, T, T*, T*, T*);                                               \
  template void RayWeightsBackward<T>(int, const T*, T, const T*, const T*, const T*, T*);
LUMEN_INSTANTIATE(float)
LUMEN_INSTANTIATE(double)
#undef LUMEN_INSTANTIATE

}  // namespace lumen
