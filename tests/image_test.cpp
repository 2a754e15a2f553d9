#include "common/image.h"

#include <cmath>

#include "common/files.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::ErrorOf;

// Values that use every bit, differ between channels and rows.
template <class T>
Image<T> Pattern(int width, int height, int channels) {
  Image<T> image(width, height, channels);
  for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<T>(i * 40503u + (i >> 3));
  return image;
}

TEST(Image, EightBitsComeBackFromEveryFormat) {
  const test::ScratchFolder scratch;
  for (const char* name : {"a.png", "a.tiff"}) {
    for (int channels : {1, 3}) {
      const Image8 image = Pattern<uint8_t>(37, 21, channels);
      WriteImage(scratch / name, image);
      const Image8 back = ReadImage8(scratch / name, channels);
      EXPECT_EQ(back.width, 37);
      EXPECT_EQ(back.height, 21);
      EXPECT_EQ(back.data, image.data) << name << " " << channels;
    }
  }
}

TEST(Image, SixteenBitsComeBack) {
  const test::ScratchFolder scratch;
  for (int channels : {1, 3}) {
    const Image16 image = Pattern<uint16_t>(33, 65, channels);
    WriteImage(scratch / "a.tiff", image);
    EXPECT_EQ(ReadImage16(scratch / "a.tiff", channels).data, image.data);
    int width = 0, height = 0;
    ReadImageSize(scratch / "a.tiff", &width, &height);
    EXPECT_EQ(width, 33);
    EXPECT_EQ(height, 65);
  }
}

// The pixels of an uncompressed TIFF lie in the file as they are.
TEST(Image, TiffIsUncompressed) {
  const test::ScratchFolder scratch;
  const Image16 image(64, 64, 1, 0x5a5a);
  WriteImage(scratch / "a.tiff", image);
  EXPECT_NE(ReadFile(scratch / "a.tiff").find(std::string(64 * 64 * 2, 0x5a)), std::string::npos);
}

// A TIFF's first image directory by hand: an independent reader.
TEST(Image, TiffIsWhatItsSpecificationSays) {
  const test::ScratchFolder scratch;
  const Image16 image = Pattern<uint16_t>(5, 3, 3);
  WriteImage(scratch / "a.tiff", image);
  const std::string bytes = ReadFile(scratch / "a.tiff");
  ASSERT_EQ(bytes.substr(0, 2), "II");
  const auto number = [&](size_t at, int size) {
    uint64_t value = 0;
    for (int i = 0; i < size; ++i) value |= uint64_t{static_cast<uint8_t>(bytes.at(at + i))} << (8 * i);
    return value;
  };
  ASSERT_EQ(number(2, 2), 42u);
  const size_t directory = number(4, 4);
  size_t strip = 0;
  uint64_t compression = 0, samples = 0;
  for (uint64_t entry = 0; entry < number(directory, 2); ++entry) {
    const size_t at = directory + 2 + entry * 12;
    const uint64_t tag = number(at, 2), value = number(at + 8, number(at + 2, 2) == 3 ? 2 : 4);
    if (tag == 259) compression = value;
    if (tag == 277) samples = value;
    if (tag == 273) strip = value;
  }
  EXPECT_EQ(compression, 1u);
  EXPECT_EQ(samples, 3u);
  for (size_t i = 0; i < image.data.size(); ++i) EXPECT_EQ(number(strip + 2 * i, 2), image.data[i]);
}

TEST(Image, GreyIsRepeatedAndAlphaLeftOut) {
  const test::ScratchFolder scratch;
  const Image8 grey = Pattern<uint8_t>(8, 8, 1);
  WriteImage(scratch / "grey.png", grey);
  const Image8 colour = ReadImage8(scratch / "grey.png", 3);
  for (int i = 0; i < 64; ++i) {
    for (int c = 0; c < 3; ++c) EXPECT_EQ(colour.data[3 * i + c], grey.data[i]);
  }
  // Transparent pixels keep their colour.
  Image8 rgba(2, 1, 4);
  rgba.data = {200, 100, 50, 0, 10, 20, 30, 128};
  WriteImage(scratch / "rgba.png", rgba);
  EXPECT_EQ(ReadImage8(scratch / "rgba.png", 3).data, (std::vector<uint8_t>{200, 100, 50, 10, 20, 30}));
}

// Row by row a file says what it does whole, in order; larger than what is read at a time (2^20 bytes).
TEST(Image, RowsAreThoseOfTheWhole) {
  const test::ScratchFolder scratch;
  WriteImage(scratch / "a.png", Pattern<uint8_t>(701, 907, 3));
  WriteImage(scratch / "a.tiff", Pattern<uint8_t>(61, 47, 3));
  WriteImage(scratch / "grey.png", Pattern<uint8_t>(1300, 830, 1));
  for (const char* name : {"a.png", "a.tiff", "grey.png"}) {
    const Image8 whole = ReadImage8(scratch / name, 3);
    int next = 0;
    ReadImage8Rows(scratch / name, 3, [&](int y, const uint8_t* row) {
      EXPECT_EQ(y, next++);
      EXPECT_TRUE(std::equal(row, row + 3 * whole.width, whole.Pixel(0, y))) << name << " " << y;
    });
    EXPECT_EQ(next, whole.height) << name;
  }
}

TEST(Image, AnotherDepthOrFewerChannelsAreErrors) {
  const test::ScratchFolder scratch;
  WriteImage(scratch / "8.png", Pattern<uint8_t>(4, 4, 1));
  WriteImage(scratch / "16.tiff", Pattern<uint16_t>(4, 4, 1));
  EXPECT_EQ(ErrorOf([&] { ReadImage16(scratch / "8.png", 1); }),
            (scratch / "8.png").string() + ": holds uint8 values, but a 16-bit image is expected");
  EXPECT_EQ(ErrorOf([&] { ReadImage8(scratch / "16.tiff", 1); }),
            (scratch / "16.tiff").string() + ": holds uint16 values, but a 8-bit image is expected");
  EXPECT_NE(ErrorOf([&] { ReadImageF(scratch / "16.tiff", 1); }), "");
  EXPECT_EQ(ErrorOf([&] { ReadImage16(scratch / "16.tiff", 3); }),
            (scratch / "16.tiff").string() + ": has 1 channels, but 3 are expected");
}

// Cut at many lengths: each is an error that names the file, none crashes, none passes.
TEST(Image, TruncatedFilesAreErrors) {
  const test::ScratchFolder scratch;
  WriteImage(scratch / "a.png", Pattern<uint8_t>(61, 47, 3));
  WriteImage(scratch / "a.tiff", Pattern<uint16_t>(61, 47, 3));
  ImageF floats(61, 47, 2);
  for (size_t i = 0; i < floats.data.size(); ++i) floats.data[i] = std::sin(static_cast<float>(i * i));
  WriteExr(scratch / "a.exr", floats, {"z", "distance"});
  for (const std::string extension : {".png", ".tiff", ".exr"}) {
    const std::string bytes = ReadFile(scratch / ("a" + extension));
    const std::filesystem::path cut = scratch / ("cut" + extension);
    for (const double part : {0.0, 0.001, 0.01, 0.1, 0.5, 0.9, 0.97}) {
      WriteFile(cut, bytes.substr(0, static_cast<size_t>(part * static_cast<double>(bytes.size()))));
      std::string error;
      if (extension == ".png") {
        error = ErrorOf([&] { ReadImage8(cut, 3); });
        EXPECT_EQ(ErrorOf([&] { ReadImage8Rows(cut, 3, [](int, const uint8_t*) {}); }), error);
      }
      if (extension == ".tiff") error = ErrorOf([&] { ReadImage16(cut, 3); });
      if (extension == ".exr") error = ErrorOf([&] { ReadImageF(cut, 2); });
      EXPECT_TRUE(error.starts_with(cut.string() + ": ")) << extension << " " << part << ": " << error;
      EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    }
  }
}

TEST(Image, MissingOrForeignFilesAreErrors) {
  const test::ScratchFolder scratch;
  WriteFile(scratch / "text.png", "no image at all");
  EXPECT_NE(ErrorOf([&] { ReadImage8(scratch / "text.png", 3); }), "");
  EXPECT_NE(ErrorOf([&] { ReadImage8(scratch / "none.png", 3); }), "");
  EXPECT_NE(ErrorOf([&] { ReadImage8(scratch.path(), 3); }), "");
  EXPECT_NE(ErrorOf([&] { WriteImage(scratch / "a.xyz", Image8(1, 1, 1)); }), "");
  EXPECT_NE(ErrorOf([&] { WriteImage(scratch / "none/a.png", Image8(1, 1, 1)); }), "");
  EXPECT_NE(ErrorOf([&] { WriteImage(scratch / "a.png", Image8()); }), "");
}

TEST(Image, ExrKeepsFloatsAndNames) {
  const test::ScratchFolder scratch;
  ImageF image(9, 7, 5);
  for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = std::ldexp(1.0f + 1e-7f * i, i % 40 - 20);
  image.data[3] = NAN;
  image.data[8] = INFINITY;
  const std::vector<std::string> names = {"radiance.R", "radiance.G", "radiance.B", "z", "distance"};
  WriteExr(scratch / "a.exr", image, names);
  std::vector<std::string> read_names;
  const ImageF back = ReadExr(scratch / "a.exr", &read_names);
  ASSERT_EQ(read_names.size(), names.size());
  ASSERT_EQ(back.data.size(), image.data.size());
  for (int c = 0; c < 5; ++c) {
    const auto found = std::find(read_names.begin(), read_names.end(), names[c]);
    ASSERT_NE(found, read_names.end()) << names[c];
    const int at = static_cast<int>(found - read_names.begin());
    for (int i = 0; i < 63; ++i) {
      const float wrote = image.data[i * 5 + c], read = back.data[i * 5 + at];
      EXPECT_TRUE(wrote == read || (std::isnan(wrote) && std::isnan(read))) << c << " " << i;
    }
  }
}

TEST(Image, SamePixelsGiveTheSameBytes) {
  const test::ScratchFolder scratch;
  for (const char* name : {"a.png", "a.tiff", "a.exr"}) {
    const std::string other = std::string("b") + std::string(name).substr(1);
    for (const std::string& file : {std::string(name), other}) {
      if (file.ends_with(".exr")) {
        WriteExr(scratch / file, ImageF(8, 8, 1, 0.25f), {"z"});
      } else {
        WriteImage(scratch / file, Pattern<uint8_t>(8, 8, 3));
      }
    }
    EXPECT_EQ(ReadFile(scratch / name), ReadFile(scratch / other));
    // Nor does the time of day get in.
    const bool has_date = ReadFile(scratch / name).find("1970") != std::string::npos;
    EXPECT_TRUE(has_date || std::string(name) == "a.png") << name;
  }
}

TEST(Image, TextIsDrawnWhereAndInTheColourAsked) {
  Image8 image(80, 30, 3, 7);
  const Rgb8 red = {255, 0, 0};
  DrawText(&image, 10, 25, 20, "MM", red);
  int drawn = 0, outside = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const uint8_t* pixel = image.Pixel(x, y);
      if (pixel[0] > 200 && pixel[1] < 5) ++drawn;
      if ((x < 9 || y > 26 || y < 5) && pixel[0] != 7) ++outside;
    }
  }
  if (drawn == 0) GTEST_SKIP() << "no font on this machine";
  EXPECT_GT(drawn, 50);
  EXPECT_EQ(outside, 0);
}

// A real frame: PNG from C3VD and 16-bit TIFFs.
TEST(Image, ReadsTheRealFrame) {
  using test::SharedData;
  const std::string folder = "c3vd/trans_t4_a_frame0010/";
  LUMEN_NEEDS_DATA(folder);
  const Image8 color = ReadImage8(SharedData(folder + "0010_color.png"), 3);
  EXPECT_EQ(color.width, 1350);
  EXPECT_EQ(color.height, 1080);
  const Image16 depth = ReadImage16(SharedData(folder + "0010_depth.tiff"), 1);
  const Image16 normals = ReadImage16(SharedData(folder + "0010_normals.tiff"), 3);
  EXPECT_EQ(depth.width, 1350);
  EXPECT_EQ(normals.height, 1080);
  const Image8 mask = ReadImage8(SharedData("c3vd/mask.png"), 1);
  EXPECT_EQ(*mask.Pixel(675, 540), 255);
  EXPECT_EQ(*mask.Pixel(0, 0), 0);
}

}  // namespace
}  // namespace lumen
