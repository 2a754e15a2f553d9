// Images as arrays of pixels, and their files (PNG, TIFF, EXR) through OpenImageIO.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace lumen {

// Row-major, channels interleaved, the upper left pixel first.
template <class T>
struct Image {
  int width = 0;
  int height = 0;
  int channels = 0;
  std::vector<T> data;

  Image() = default;
  Image(int width, int height, int channels, T value = T{})
      : width(width), height(height), channels(channels), data(size_t(width) * height * channels, value) {}

  bool empty() const { return data.empty(); }
  T* Pixel(int x, int y) { return data.data() + (size_t(y) * width + x) * channels; }
  const T* Pixel(int x, int y) const { return data.data() + (size_t(y) * width + x) * channels; }
};

using Rgb8 = std::array<uint8_t, 3>;
using Image8 = Image<uint8_t>;
using Image16 = Image<uint16_t>;
using ImageF = Image<float>;

// Reads the file's first `channels` channels. Integer files keep their own steps: a file of another depth
// than T is an InputError, as are a missing, truncated or unreadable file and one with fewer channels (naming
// the file and what was found). A grey PNG read as 3 channels is repeated; an alpha channel is left out.
Image8 ReadImage8(const std::filesystem::path& file, int channels);
Image16 ReadImage16(const std::filesystem::path& file, int channels);
ImageF ReadImageF(const std::filesystem::path& file, int channels);

// The same row by row, from the top, for files larger than memory should hold: row(y, pixels), of `channels`
// each. An interlaced PNG and a tiled TIFF are held whole all the same. Throws InputError, where the file is
// damaged maybe only after its last row.
void ReadImage8Rows(const std::filesystem::path& file, int channels,
                    const std::function<void(int, const uint8_t*)>& row);

// Writes an image whole or not at all; the extension chooses the format (TIFF without compression, as
// C3VD's). Throws InputError.
void WriteImage(const std::filesystem::path& file, const Image8& image);
void WriteImage(const std::filesystem::path& file, const Image16& image);

// A float32 EXR with named channels ("radiance.R", "z", …); image.channels names, in order.
void WriteExr(const std::filesystem::path& file, const ImageF& image,
              const std::vector<std::string>& channel_names);
// Reads any float EXR, with the names of its channels, in the order in which EXR readers give them (not
// always that of writing). Throws InputError.
ImageF ReadExr(const std::filesystem::path& file, std::vector<std::string>* channel_names);

// Width and height without reading the pixels. Throws InputError.
void ReadImageSize(const std::filesystem::path& file, int* width, int* height);

enum class TextAlign { kLeft, kCentre, kRight };

// Writes text (UTF-8) into an 8-bit RGB image: its base line at height y, its left end, middle or right end
// at x. Does nothing where the machine has no font.
void DrawText(Image8* image, int x, int y, int size_px, const std::string& text, const Rgb8& color,
              TextAlign align = TextAlign::kLeft);

}  // namespace lumen
