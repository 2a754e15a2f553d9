// The numbers in the tables were computed apart from this code, in 50-digit decimal arithmetic (Python's
// `decimal`; sine and cosine by their Taylor series, inverses by 160 bisections), from the formulas
//   Scaramuzza: uv = S⁻¹(px − c), ρ = |uv|, ray ∝ (u, v, a0 + a2 ρ² + a3 ρ³ + a4 ρ⁴), S = [[c, e], [d, 1]]
//   Kannala–Brandt: px = c + f · (θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹) · (x, y)/|(x, y)|
// and rounded to 19 decimals.
#include "common/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "common/error.h"

namespace lumen {
namespace {

struct PixelAndRay {
  Vec2d pixel;
  Vec3d ray;  // or a point on it, of any length
};

const std::vector<PixelAndRay> kC3vdRays = {
    {{678.544839263292, 542.975887548343}, {0, 0, 1}},
    {{678, 542}, {-0.0007120418417251367, -0.0012665803556499331, 0.9999989443847519954}},
    {{679, 543}, {0.0005917947043895804, 0.0000296396764252962, 0.9999998244502433101}},
    {{0, 0}, {-0.7756611000139690079, -0.6169818134151882815, -0.1329785691005334946}},
    {{1349, 0}, {0.7704472075293364026, -0.6276746836931863874, -0.1115149849164051285}},
    {{0, 1079}, {-0.7774049104090892663, 0.6177988690673248480, -0.1181785202605376187}},
    {{1349, 1079}, {0.7791886312198863010, 0.6192343923603460993, -0.0970249673836222826}},
    {{675, 540}, {-0.0046197191574770141, -0.0038552890714112379, 0.9999818973066871959}},
    {{150, 540}, {-0.6987180219909118352, -0.0019197157212396890, 0.7153946047019485806}},
    {{1200, 540}, {0.6890198454521848239, -0.0059184732679270010, 0.7247183068249512446}},
    {{675, 20}, {-0.0067323246321193850, -0.6910837708172667057, 0.7227433137138214617}},
    {{675, 1060}, {-0.0026589152139627352, 0.6829911581591472054, 0.7304218014587952626}},
    {{337, 270}, {-0.4500818737453567024, -0.3575738759328129224, 0.8182708782403624687}},
    {{1012, 810}, {0.4391938055391265048, 0.3495972357650775268, 0.8275811585104368066}},
    {{700, 300}, {0.0270828124637879608, -0.3174343393892884814, 0.9478934335913174300}},
};

const std::vector<PixelAndRay> kC3vdPoints = {
    {{1213.2400336944591206926, 544.5172940814017499146}, {1, 0, 1}},
    {{676.9604283217714666279, 1077.6780960694112949583}, {0, 1, 1}},
    {{450.6451621025734877840, 601.5284862966814748871}, {-12.5, 3.25, 40}},
    {{1178.3292849220303766866, -119.3545213537750501697}, {3, -4, 0}},
    {{433.8934528253146298185, 1372.6571752604821319579}, {-7, 24, -3}},
    {{678.5589082142033346465, 542.9479553725156701950}, {0.001, -0.002, 55}},
    {{1225.9284383025373316900, 1093.5761925144951100032}, {20, 20, 5}},
};

const std::vector<PixelAndRay> kEndomapperRays = {
    {{734.7278, 552.0724}, {0, 0, 1}},
    {{734, 552}, {-0.0010140852792883559, -0.0001008326464493749, 0.9999994807317770506}},
    {{735, 552}, {0.0003792718049140661, -0.0001008326488581624, 0.9999999229928344957}},
    {{0, 552}, {-0.9821403266813371710, -0.0000967354841405510, 0.1881498587523318053}},
    {{1439, 552}, {0.9480027725881766097, -0.0000974109548555763, 0.3182620518947173773}},
    {{720, 0}, {-0.0201600820242666326, -0.7553541595126080600, 0.6550066143175779412}},
    {{720, 1079}, {-0.0201965007779821046, 0.7222530296255794082, 0.6913339732379690322}},
    {{200, 100}, {-0.7203157435449891709, -0.6086930028651144380, 0.3326229965956641100}},
    {{1000, 700}, {0.3677949582839006886, 0.2050045103473517651, 0.9070281249212652145}},
    {{100, 900}, {-0.8509615503706339546, 0.4662420838356085488, 0.2418320885478938678}},
    {{1200, 300}, {0.6379383677190133333, -0.3454594580699451149, 0.6882531524243247228}},
};

const std::vector<PixelAndRay> kEndomapperPoints = {
    {{1249.9624802769103724211, 552.0724}, {1, 0, 1}},
    {{734.7278, 1067.5442045980778823651}, {0, 1, 1}},
    {{520.7453253746903598606, 607.7334482720791979224}, {-12.5, 3.25, 40}},
    {{1188.7522275662705904880, -53.5721084620801384905}, {3, -4, 0}},
    {{522.4329845055456672095, 1280.2753224824828665129}, {-7, 24, -1}},
    {{734.7408489290807073684, 552.0462901309295037443}, {0.001, -0.002, 55}},
    {{1256.0407112200889750683, 1073.6252329002881518290}, {20, 20, 5}},
};

// θ and r(θ) where EndoMapper's polynomial folds back.
constexpr double kFoldAngle = 1.6450227198526136333;
constexpr double kFoldRadius = 1.0569974947422536987;

// Between a pixel and its direction lie some sixteen roundings, each of one part in 2/ε, of lengths below 900
// px (the farthest corner is 926 px from EndoMapper's centre but has no ray); the pixel itself is rounded
// below 2048 px.
template <class T>
double PixelBound() {
  return std::numeric_limits<T>::epsilon() / 2 * (16 * 900 + 2048);
}

// The same roundings of a unit vector.
template <class T>
double RayBound() {
  return std::numeric_limits<T>::epsilon() / 2 * 16;
}

template <class T>
double LargestRayError(const CameraIntrinsics& intrinsics, const std::vector<PixelAndRay>& examples) {
  const Camera<T> camera(intrinsics);
  double largest = 0;
  for (const PixelAndRay& example : examples) {
    const auto ray = camera.Unproject(example.pixel.cast<T>());
    if (!ray) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, (ray->template cast<double>() - example.ray).norm());
  }
  return largest;
}

template <class T>
double LargestPixelError(const CameraIntrinsics& intrinsics, const std::vector<PixelAndRay>& examples) {
  const Camera<T> camera(intrinsics);
  double largest = 0;
  for (const PixelAndRay& example : examples) {
    const auto pixel = camera.Project(example.ray.cast<T>());
    if (!pixel) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, (pixel->template cast<double>() - example.pixel).norm());
  }
  return largest;
}

struct RoundTrip {
  double largest_error_px = 0;
  double largest_norm_error = 0;  // of the rays, which are unit vectors
  int without_ray = 0;
  int lost = 0;  // pixels whose ray no pixel sees
};

template <class T>
RoundTrip GoOverEveryPixel(const CameraIntrinsics& intrinsics) {
  const Camera<T> camera(intrinsics);
  RoundTrip result;
  for (int y = 0; y < intrinsics.height; ++y) {
    for (int x = 0; x < intrinsics.width; ++x) {
      const auto ray = camera.Unproject(Vec2<T>(x, y));
      if (!ray) {
        ++result.without_ray;
        continue;
      }
      result.largest_norm_error = std::max(result.largest_norm_error, std::abs(double(ray->norm()) - 1));
      const auto pixel = camera.Project(*ray);
      if (!pixel) {
        ++result.lost;
        continue;
      }
      const double error = (pixel->template cast<double>() - Vec2d(x, y)).norm();
      result.largest_error_px = std::max(result.largest_error_px, error);
    }
  }
  return result;
}

template <class T>
class CameraOf : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(CameraOf, Scalars);

TYPED_TEST(CameraOf, C3vdAgreesWithNumbersWorkedOutApart) {
  EXPECT_LT(LargestRayError<TypeParam>(C3vdIntrinsics(), kC3vdRays), RayBound<TypeParam>());
  EXPECT_LT(LargestPixelError<TypeParam>(C3vdIntrinsics(), kC3vdPoints), PixelBound<TypeParam>());
}

TYPED_TEST(CameraOf, EndomapperAgreesWithNumbersWorkedOutApart) {
  // Near the fold a pixel's rounding is magnified by 1/r′(θ), below 4 for every pixel of the table.
  EXPECT_LT(LargestRayError<TypeParam>(EndomapperIntrinsics(), kEndomapperRays), 4 * RayBound<TypeParam>());
  EXPECT_LT(LargestPixelError<TypeParam>(EndomapperIntrinsics(), kEndomapperPoints), PixelBound<TypeParam>());
}

// The comparison above must tell C3VD's camera from the one with S transposed, as its Python example has it.
TEST(Camera, TransposedStretchIsAnotherCamera) {
  CameraIntrinsics transposed = C3vdIntrinsics();
  std::swap(transposed.stretch[1], transposed.stretch[2]);
  EXPECT_GT(LargestRayError<double>(transposed, kC3vdRays), 0.004);
  const auto pixel = Camera<double>(transposed).Project(kC3vdRays[3].ray);
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->norm(), 5, 0.2);  // 0.33° of roll at 869 px
}

TYPED_TEST(CameraOf, EveryPixelOfC3vdComesBack) {
  const RoundTrip trip = GoOverEveryPixel<TypeParam>(C3vdIntrinsics());
  EXPECT_EQ(trip.without_ray, 0);
  EXPECT_EQ(trip.lost, 0);
  EXPECT_LT(trip.largest_error_px, PixelBound<TypeParam>());
  EXPECT_LT(trip.largest_norm_error, RayBound<TypeParam>());
}

TYPED_TEST(CameraOf, EveryPixelOfEndomapperComesBackOrHasNoRay) {
  const CameraIntrinsics in = EndomapperIntrinsics();
  const RoundTrip trip = GoOverEveryPixel<TypeParam>(in);
  int beyond_fold = 0;
  for (int y = 0; y < in.height; ++y) {
    for (int x = 0; x < in.width; ++x) {
      beyond_fold += std::hypot((x - in.cx) / in.fx, (y - in.cy) / in.fy) > kFoldRadius;
    }
  }
  EXPECT_GT(beyond_fold, 90000);
  EXPECT_EQ(trip.without_ray, beyond_fold);
  EXPECT_EQ(trip.lost, 0);
  EXPECT_LT(trip.largest_error_px, PixelBound<TypeParam>());
  EXPECT_LT(trip.largest_norm_error, RayBound<TypeParam>());
}

TEST(Camera, DoubleBoundIsBelowANanopixel) { EXPECT_LT(PixelBound<double>(), 1e-9); }

TYPED_TEST(CameraOf, PrincipalPointIsExact) {
  for (const CameraIntrinsics& in : {C3vdIntrinsics(), EndomapperIntrinsics()}) {
    const Camera<TypeParam> camera(in);
    const Vec2<TypeParam> centre = Vec2d(in.cx, in.cy).cast<TypeParam>();
    EXPECT_EQ(camera.Unproject(centre), (Vec3<TypeParam>(0, 0, 1)));
    EXPECT_EQ(camera.Project({0, 0, 7}), centre);
  }
}

TYPED_TEST(CameraOf, EndomapperEndsAtTheFold) {
  using T = TypeParam;
  const CameraIntrinsics in = EndomapperIntrinsics();
  const Camera<T> camera(in);
  EXPECT_NEAR(camera.max_angle_rad(), kFoldAngle, 4 * std::numeric_limits<T>::epsilon());

  // r folds at x = 1493.3255: a pixel within a hundredth before it, one beyond. Before it a rounding of the
  // pixel counts 1/r′(θ) = 260 times.
  const auto ray = camera.Unproject(Vec2d(1493.32, 552.0724).cast<T>());
  ASSERT_TRUE(ray);
  EXPECT_LT((ray->template cast<double>() - Vec3d(0.9975355982421420057, 0, -0.0701621710018429734)).norm(),
            260 * RayBound<T>());
  EXPECT_FALSE(camera.Unproject(Vec2d(1493.33, 552.0724).cast<T>()));
  EXPECT_FALSE(camera.Unproject({0, 0}));
  EXPECT_FALSE(camera.Unproject({1439, 1079}));

  for (const double beyond_rad : {-1e-5, 1e-5}) {
    const double angle = kFoldAngle + beyond_rad;
    const Vec3d point = 30 * Vec3d(0.6 * std::sin(angle), -0.8 * std::sin(angle), std::cos(angle));
    EXPECT_EQ(camera.Project(point.cast<T>()).has_value(), beyond_rad < 0);
  }
  EXPECT_FALSE(camera.Project({-7, 24, -3}));
}

// atan2(ρ, z) grows without end on C3VD's polynomial, towards straight behind.
TYPED_TEST(CameraOf, C3vdSeesAllButStraightBehind) {
  using T = TypeParam;
  const Camera<T> camera(C3vdIntrinsics());
  EXPECT_NEAR(camera.max_angle_rad(), kPi, 4 * std::numeric_limits<T>::epsilon());
  EXPECT_FALSE(camera.Project({0, 0, -1}));
  const Vec3<T> nearly_behind = Vec3<T>(1e-3, 2e-3, -1).normalized();
  const auto pixel = camera.Project(nearly_behind);
  ASSERT_TRUE(pixel);
  const auto ray = camera.Unproject(*pixel);
  ASSERT_TRUE(ray);
  EXPECT_LT((*ray - nearly_behind).norm(), RayBound<T>());
}

TEST(Camera, NoPixelSeesTheOriginOrNotANumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CameraIntrinsics pinhole = EndomapperIntrinsics();
  pinhole.model = CameraModel::kPinhole;
  for (const CameraIntrinsics& in : {pinhole, C3vdIntrinsics(), EndomapperIntrinsics()}) {
    const Camera<double> camera(in);
    EXPECT_FALSE(camera.Project({0, 0, 0}));
    EXPECT_FALSE(camera.Project({nan, 0, 1}));
    EXPECT_FALSE(camera.Project({1, 0, nan}));
    EXPECT_FALSE(camera.Unproject({nan, 3}));
  }
}

TEST(Camera, PinholeSeesInFrontOnly) {
  CameraIntrinsics in;
  in.width = 640;
  in.height = 480;
  in.fx = 500;
  in.fy = 400;
  in.cx = 320;
  in.cy = 240;
  const Camera<double> camera(in);
  EXPECT_EQ(camera.Project({1, -2, 4}), Vec2d(445, 40));  // 320 + 500/4, 240 − 400/2
  EXPECT_FALSE(camera.Project({1, -2, 0}));
  EXPECT_FALSE(camera.Project({1, -2, -4}));
  EXPECT_FALSE(camera.Project({0, 0, -1}));
  const auto ray = camera.Unproject({445, 40});
  ASSERT_TRUE(ray);
  EXPECT_LT((*ray - Vec3d(1, -2, 4) / std::sqrt(21)).norm(), 1e-15);
  EXPECT_EQ(camera.max_angle_rad(), kPi / 2);
}

// Pixel edges scale: the point x + ½ of the large image is the point s(x + ½) of the small one.
TEST(Camera, ResizedCameraSeesTheSame) {
  for (const CameraIntrinsics& in : {C3vdIntrinsics(), EndomapperIntrinsics()}) {
    for (const auto& [width, height] : {std::pair(in.width / 2, in.height / 2), std::pair(640, 360)}) {
      const CameraIntrinsics small = Resized(in, width, height);
      EXPECT_EQ(small.width, width);
      EXPECT_EQ(small.height, height);
      for (const Vec2d& pixel :
           {Vec2d(100, 500), Vec2d(700, 30), Vec2d(1200.25, 777.5), Vec2d(in.cx, in.cy)}) {
        const Vec2d moved((pixel.x() + 0.5) * width / in.width - 0.5,
                          (pixel.y() + 0.5) * height / in.height - 0.5);
        const auto expected = Camera<double>(in).Unproject(pixel);
        const auto found = Camera<double>(small).Unproject(moved);
        ASSERT_TRUE(expected && found);
        EXPECT_LT((*expected - *found).norm(), 1e-14);
      }
    }
  }
}

TEST(Camera, RefusesParametersThatDescribeNone) {
  const auto refused = [](CameraIntrinsics in, void (*spoil)(CameraIntrinsics*)) {
    spoil(&in);
    EXPECT_THROW(Camera<double>{in}, InputError);
  };
  refused(EndomapperIntrinsics(), [](CameraIntrinsics* in) { in->fx = 0; });
  refused(EndomapperIntrinsics(), [](CameraIntrinsics* in) { in->fy = -1; });
  refused(EndomapperIntrinsics(), [](CameraIntrinsics* in) { in->k[2] = NAN; });
  refused(EndomapperIntrinsics(), [](CameraIntrinsics* in) { in->width = 0; });
  refused(C3vdIntrinsics(), [](CameraIntrinsics* in) { in->cy = INFINITY; });
  refused(C3vdIntrinsics(), [](CameraIntrinsics* in) { in->a[0] = -769; });
  refused(C3vdIntrinsics(), [](CameraIntrinsics* in) { in->a[1] = 0.1; });
  refused(C3vdIntrinsics(), [](CameraIntrinsics* in) { in->stretch = {1, 1, 1}; });
  EXPECT_THROW(Resized(C3vdIntrinsics(), 0, 100), InputError);
  EXPECT_THROW(Resized(CameraIntrinsics{}, 10, 10), InputError);
}

// Against central differences of Unproject: a pixel's square spans |∂r/∂x × ∂r/∂y| sr. Steps of h px leave
// some h²/f² ≈ 1e-8 of it and roundings of ε/h ≈ 1e-13.
TEST(Camera, AreaPerSteradianIsTheInverseOfThePixelsSolidAngle) {
  CameraIntrinsics pinhole;
  pinhole.width = 200;
  pinhole.height = 160;
  pinhole.cx = 90;
  pinhole.cy = 85;
  pinhole.fx = 150;
  pinhole.fy = 170;
  CameraIntrinsics stretched = C3vdIntrinsics();
  stretched.stretch = {1.1, 0.2, -0.1};
  for (const CameraIntrinsics& intrinsics : {pinhole, C3vdIntrinsics(), stretched, EndomapperIntrinsics()}) {
    const Camera<double> camera(intrinsics);
    constexpr double kStep_px = 1e-3;
    for (int i = 0; i < 25; ++i) {
      const Vec2d pixel(intrinsics.width * (0.15 + 0.17 * (i % 5)),
                        intrinsics.height * (0.15 + 0.17 * (i / 5)));
      const auto slope = [&](const Vec2d& step) {
        return Vec3d((*camera.Unproject(pixel + step) - *camera.Unproject(pixel - step)) / (2 * kStep_px));
      };
      const double solid_angle = slope(Vec2d(kStep_px, 0)).cross(slope(Vec2d(0, kStep_px))).norm();
      const Vec3d ray = *camera.Unproject(pixel);
      EXPECT_NEAR(camera.AreaPerSteradian(pixel, 7 * ray) * solid_angle, 1, 1e-6) << i;
      const auto in_float =
          Camera<float>(intrinsics).AreaPerSteradian(pixel.cast<float>(), ray.cast<float>());
      EXPECT_NEAR(in_float * solid_angle, 1, 1e-4) << i;
    }
    const Vec2d middle(intrinsics.cx, intrinsics.cy);
    const Vec2d beside(intrinsics.cx + 0.01, intrinsics.cy);
    EXPECT_NEAR(camera.AreaPerSteradian(middle, Vec3d::UnitZ()) /
                    camera.AreaPerSteradian(beside, *camera.Unproject(beside)),
                1, 1e-6);
  }
}

}  // namespace
}  // namespace lumen
