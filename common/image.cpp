#include "common/image.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string_view>

#include "common/error.h"
#include "common/files.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;
using OIIO::TypeDesc;

// More than any endoscope has; a damaged header must not ask for all the memory there is.
constexpr int64_t kMostPixels = int64_t{1} << 28;

[[noreturn]] void Fail(const fs::path& file, const std::string& problem) {
  // Libraries' messages may span lines; an InputError is one.
  std::string line = problem;
  while (!line.empty() && (line.back() == '\n' || line.back() == '.')) line.pop_back();
  std::replace(line.begin(), line.end(), '\n', ' ');
  throw InputError(file.string() + ": " + line);
}

std::string ErrorOr(std::string error, const std::string& otherwise) {
  return error.empty() ? otherwise : error;
}

// Whether a PNG file has all its chunks (ISO/IEC 15948, 5.3). libpng finds this out too, but tells stderr.
bool IsCutPng(const fs::path& file) {
  constexpr std::string_view kSignature = "\x89PNG\r\n\x1a\n";
  std::ifstream stream(file, std::ios::binary);
  char head[8];
  if (!stream.read(head, 8) || std::string_view(head, 8) != kSignature) return false;
  while (stream.read(head, 8)) {  // a chunk's length and type; its data and check sum follow
    if (std::string_view(head + 4, 4) == "IEND") return false;
    uint32_t length = 0;
    for (int i = 0; i < 4; ++i) length = length << 8 | static_cast<uint8_t>(head[i]);
    stream.seekg(int64_t{length} + 4, std::ios::cur);
  }
  return true;
}

std::unique_ptr<OIIO::ImageInput> Open(const fs::path& file) {
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) Fail(file, "no such image file");
  if (IsCutPng(file)) Fail(file, "damaged or cut short: the PNG file has no end");
  // Colours are wanted as they are stored, not multiplied by alpha.
  OIIO::ImageSpec as_stored;
  as_stored.attribute("oiio:UnassociatedAlpha", 1);
  auto input = OIIO::ImageInput::open(file.string(), &as_stored);
  if (!input) Fail(file, "not an image that can be read: " + ErrorOr(OIIO::geterror(), "unknown format"));
  const OIIO::ImageSpec& spec = input->spec();
  if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1 || spec.depth > 1 ||
      int64_t{spec.width} * spec.height > kMostPixels) {
    Fail(file, "not a usable image: " + std::to_string(spec.width) + "×" + std::to_string(spec.height) +
                   " pixels of " + std::to_string(spec.nchannels) + " channels");
  }
  return input;
}

template <class T>
struct Depth;
template <>
struct Depth<uint8_t> {
  static constexpr const char* kName = "8-bit";
  static constexpr bool kRepeatsGrey = true;
  static bool Fits(TypeDesc format) { return format == TypeDesc::UINT8; }
};
template <>
struct Depth<uint16_t> {
  static constexpr const char* kName = "16-bit";
  static constexpr bool kRepeatsGrey = false;
  static bool Fits(TypeDesc format) { return format == TypeDesc::UINT16; }
};
template <>
struct Depth<float> {
  static constexpr const char* kName = "floating-point";
  static constexpr bool kRepeatsGrey = false;
  static bool Fits(TypeDesc format) { return format == TypeDesc::FLOAT || format == TypeDesc::HALF; }
};

[[noreturn]] void FailToRead(const fs::path& file, OIIO::ImageInput* input) {
  Fail(file, "damaged or cut short: " + ErrorOr(input->geterror(), "its pixels can't be read"));
}

// Reads the first `channels` channels of an open file into interleaved pixels.
template <class T>
Image<T> ReadPixels(const fs::path& file, OIIO::ImageInput* input, int channels) {
  Image<T> image(input->spec().width, input->spec().height, channels);
  if (!input->read_image(0, 0, 0, channels, OIIO::BaseTypeFromC<T>::value, image.data.data()))
    FailToRead(file, input);
  // Some readers (PNG) deliver what there is of a truncated file and complain only in the end.
  if (input->has_error()) FailToRead(file, input);
  return image;
}

template <class T>
Image<T> RepeatedGrey(const Image<T>& grey, int channels) {
  Image<T> image(grey.width, grey.height, channels);
  for (size_t i = 0; i < grey.data.size(); ++i) {
    std::fill_n(image.data.begin() + static_cast<ptrdiff_t>(i * channels), channels, grey.data[i]);
  }
  return image;
}

// How many of an open file's channels are read where `channels` are wanted: those, or a single one that is to
// be repeated.
template <class T>
int ChannelsToRead(const fs::path& file, const OIIO::ImageSpec& spec, int channels) {
  bool fits = Depth<T>::Fits(spec.format);
  for (const TypeDesc& format : spec.channelformats) fits = fits && Depth<T>::Fits(format);
  if (!fits) {
    Fail(file, std::string("holds ") + spec.format.c_str() + " values, but a " + Depth<T>::kName +
                   " image is expected");
  }
  const int colours = spec.nchannels - (spec.alpha_channel >= 0 ? 1 : 0);
  if (colours == 1 && channels > 1 && Depth<T>::kRepeatsGrey) return 1;
  if (colours < channels) {
    Fail(file,
         "has " + std::to_string(colours) + " channels, but " + std::to_string(channels) + " are expected");
  }
  return channels;
}

template <class T>
Image<T> Read(const fs::path& file, int channels) {
  const auto input = Open(file);
  const int stored = ChannelsToRead<T>(file, input->spec(), channels);
  Image<T> image = ReadPixels<T>(file, input.get(), stored);
  return stored == channels ? image : RepeatedGrey(image, channels);
}

// Writes interleaved pixels of `spec`'s size, channels and type.
void Write(const fs::path& file, OIIO::ImageSpec spec, const void* pixels) {
  if (spec.width < 1 || spec.height < 1) Fail(file, "an image without pixels can't be written");
  // The writers would put the time of day here, and the same run would not give the same bytes.
  spec.attribute("DateTime", "1970:01:01 00:00:00");
  spec.attribute("Software", "lumen");
  spec.attribute("oiio:UnassociatedAlpha", 1);
  PendingFile pending(file);
  const auto output = OIIO::ImageOutput::create(pending.path().string());
  if (!output) Fail(file, "unknown image format (use .png, .tiff or .exr): " + OIIO::geterror());
  if (!output->open(pending.path().string(), spec)) Fail(file, "cannot write: " + output->geterror());
  const bool written = output->write_image(spec.format, pixels);
  const std::string error = output->geterror();
  if (!output->close() || !written) {
    Fail(file, "cannot write: " + ErrorOr(error + output->geterror(), "is the disk full?"));
  }
  pending.Commit();
}

template <class T>
void WriteInteger(const fs::path& file, const Image<T>& image) {
  OIIO::ImageSpec spec(image.width, image.height, image.channels, OIIO::BaseTypeFromC<T>::value);
  const std::string extension = file.extension().string();
  if (extension == ".tiff" || extension == ".tif") spec.attribute("compression", "none");
  Write(file, spec, image.data.data());
}

}  // namespace

Image8 ReadImage8(const fs::path& file, int channels) { return Read<uint8_t>(file, channels); }
void ReadImage8Rows(const fs::path& file, int channels, const std::function<void(int, const uint8_t*)>& row) {
  const auto input = Open(file);
  const OIIO::ImageSpec& spec = input->spec();
  const int stored = ChannelsToRead<uint8_t>(file, spec, channels);
  // A tile reaches over rows.
  constexpr int kBytes = 1 << 20;
  const int at_once = spec.tile_width > 0 ? spec.height : std::max(1, kBytes / (spec.width * stored));
  for (int first = 0; first < spec.height; first += at_once) {
    Image8 rows(spec.width, std::min(at_once, spec.height - first), stored);
    const bool read = spec.tile_width > 0
                          ? input->read_image(0, 0, 0, stored, TypeDesc::UINT8, rows.data.data())
                          : input->read_scanlines(0, 0, spec.y + first, spec.y + first + rows.height, 0, 0,
                                                  stored, TypeDesc::UINT8, rows.data.data());
    if (!read) FailToRead(file, input.get());
    if (stored != channels) rows = RepeatedGrey(rows, channels);
    for (int y = 0; y < rows.height; ++y) row(first + y, rows.Pixel(0, y));
  }
  if (input->has_error()) FailToRead(file, input.get());
}
Image16 ReadImage16(const fs::path& file, int channels) { return Read<uint16_t>(file, channels); }
ImageF ReadImageF(const fs::path& file, int channels) { return Read<float>(file, channels); }

void WriteImage(const fs::path& file, const Image8& image) { WriteInteger(file, image); }
void WriteImage(const fs::path& file, const Image16& image) { WriteInteger(file, image); }

void WriteExr(const fs::path& file, const ImageF& image, const std::vector<std::string>& channel_names) {
  if (file.extension() != ".exr") Fail(file, "a float image is written as .exr");
  if (channel_names.size() != static_cast<size_t>(image.channels)) {
    throw std::logic_error("WriteExr: a name per channel is needed");
  }
  OIIO::ImageSpec spec(image.width, image.height, image.channels, TypeDesc::FLOAT);
  spec.channelnames = channel_names;
  spec.attribute("compression", "zip");
  Write(file, spec, image.data.data());
}

ImageF ReadExr(const fs::path& file, std::vector<std::string>* channel_names) {
  const auto input = Open(file);
  if (!Depth<float>::Fits(input->spec().format)) Fail(file, "a floating-point image is expected");
  *channel_names = input->spec().channelnames;
  return ReadPixels<float>(file, input.get(), input->spec().nchannels);
}

void ReadImageSize(const fs::path& file, int* width, int* height) {
  const auto input = Open(file);
  *width = input->spec().width;
  *height = input->spec().height;
}

}  // namespace lumen
