#include "common/jpeg.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <memory>
#include <stdexcept>
#include <string>

namespace lumen {

Image8 ThroughJpeg(const Image8& image, int quality) {
  const auto fail = [](const std::string& step, const std::string& problem) {
    throw std::runtime_error("JPEG, " + step + ": " + problem);
  };
  const std::string name = "memory.jpg";  // never opened: its ending chooses the format
  std::vector<unsigned char> encoded;
  {
    OIIO::Filesystem::IOVecOutput memory(encoded);
    OIIO::ImageSpec spec(image.width, image.height, image.channels, OIIO::TypeDesc::UINT8);
    spec.attribute("Compression", "jpeg:" + std::to_string(quality));
    spec.attribute("jpeg:subsampling", "4:2:0");
    const auto output = OIIO::ImageOutput::create(name);
    if (!output) fail("encoding", OIIO::geterror());
    if (!output->set_ioproxy(&memory)) fail("encoding", "this OpenImageIO can't do so in memory");
    if (!output->open(name, spec) || !output->write_image(OIIO::TypeDesc::UINT8, image.data.data()) ||
        !output->close()) {
      fail("encoding", output->geterror());
    }
  }
  OIIO::Filesystem::IOMemReader memory(encoded.data(), encoded.size());
  const auto input = OIIO::ImageInput::open(name, nullptr, &memory);
  if (!input) fail("decoding", OIIO::geterror());
  Image8 decoded(image.width, image.height, image.channels);
  if (!input->read_image(0, 0, 0, image.channels, OIIO::TypeDesc::UINT8, decoded.data.data())) {
    fail("decoding", input->geterror());
  }
  return decoded;
}

}  // namespace lumen
