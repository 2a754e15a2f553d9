// Text in pictures: DrawText of image.h.
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>

#include <string_view>

#include "common/image.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

std::string FontFile() {
  for (const char* folder :
       {"/usr/share/fonts/truetype/dejavu", "/usr/share/fonts/dejavu", "/usr/share/fonts/TTF"}) {
    const fs::path font = fs::path(folder) / "DejaVuSans.ttf";
    std::error_code ignored;
    if (fs::exists(font, ignored)) return font.string();
  }
  return "";
}

// OpenImageIO 2.4 draws a box for what isn't ASCII.
std::string InAscii(const std::string& text) {
  constexpr std::pair<std::string_view, std::string_view> kReplacements[] = {
      {"×", "x"}, {"±", "+-"}, {"–", "-"}, {"°", " deg"}, {"…", "..."}};
  std::string ascii = text;
  for (const auto& [from, to] : kReplacements) {
    for (size_t at = ascii.find(from); at != std::string::npos; at = ascii.find(from, at + to.size())) {
      ascii.replace(at, from.size(), to);
    }
  }
  return ascii;
}

}  // namespace

void DrawText(Image8* image, int x, int y, int size_px, const std::string& text, const Rgb8& color,
              TextAlign align) {
  static const std::string font = FontFile();
  if (font.empty() || image->empty()) return;
  const OIIO::ImageSpec spec(image->width, image->height, image->channels, OIIO::TypeDesc::UINT8);
  OIIO::ImageBuf buffer(spec, image->data.data());
  const float ink[3] = {color[0] / 255.0f, color[1] / 255.0f, color[2] / 255.0f};
  using AlignX = OIIO::ImageBufAlgo::TextAlignX;
  const AlignX align_x = align == TextAlign::kLeft     ? AlignX::Left
                         : align == TextAlign::kCentre ? AlignX::Center
                                                       : AlignX::Right;
  OIIO::ImageBufAlgo::render_text(buffer, x, y, InAscii(text), size_px, font, ink, align_x);
}

}  // namespace lumen
