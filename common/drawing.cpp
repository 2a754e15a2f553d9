#include "common/drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/files.h"

namespace lumen {
namespace {

constexpr double kDash = 6, kGapInDash = 4;

template <class... Cases>
struct Overloaded : Cases... {
  using Cases::operator()...;
};

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (char c : text) {
    if (c == '<') {
      escaped += "&lt;";
    } else if (c == '>') {
      escaped += "&gt;";
    } else if (c == '&') {
      escaped += "&amp;";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string Hex(const Rgb8& color) {
  return fmt::format("#{:02x}{:02x}{:02x}", color[0], color[1], color[2]);
}

std::string Svg(const DrawnLine& line) {
  std::string points;
  for (const Vec2d& p : line.points) {
    points += fmt::format("{}{:.2f},{:.2f}", points.empty() ? "" : " ", p.x(), p.y());
  }
  return fmt::format(R"(<polyline points="{}" fill="none" stroke="{}" stroke-width="{:g}"{}/>)", points,
                     Hex(line.color), line.width,
                     line.dashed ? fmt::format(R"( stroke-dasharray="{:g} {:g}")", kDash, kGapInDash) : "");
}

std::string Svg(const DrawnDisc& disc) {
  const std::string paint = disc.ring > 0 ? fmt::format(R"(fill="none" stroke="{}" stroke-width="{:g}")",
                                                        Hex(disc.color), disc.ring)
                                          : fmt::format(R"(fill="{}")", Hex(disc.color));
  return fmt::format(R"(<circle cx="{:.2f}" cy="{:.2f}" r="{:g}" {}/>)", disc.centre.x(), disc.centre.y(),
                     disc.radius, paint);
}

std::string Svg(const DrawnBox& box) {
  const Vec2d size = box.high - box.low;
  return fmt::format(R"(<rect x="{:.2f}" y="{:.2f}" width="{:.2f}" height="{:.2f}" fill="{}"/>)", box.low.x(),
                     box.low.y(), size.x(), size.y(), Hex(box.color));
}

std::string Svg(const DrawnText& text) {
  const char* anchor = text.align == TextAlign::kLeft     ? "start"
                       : text.align == TextAlign::kCentre ? "middle"
                                                          : "end";
  return fmt::format(R"(<text x="{:.2f}" y="{:.2f}" font-size="{:g}" fill="{}" text-anchor="{}">{}</text>)",
                     text.at.x(), text.at.y(), text.size, Hex(text.color), anchor, Escaped(text.text));
}

double DistanceToSegment(const Vec2d& p, const Vec2d& a, const Vec2d& b) {
  const double squared = (b - a).squaredNorm();
  const double along = squared > 0 ? std::clamp((p - a).dot(b - a) / squared, 0.0, 1.0) : 0;
  return (p - a - along * (b - a)).norm();
}

// Paints what lies within `reach` px of a shape, given by its distance function; the last pixel in part.
template <class Distance>
void Paint(Image8* image, const Vec2d& low, const Vec2d& high, double reach, const Rgb8& color,
           const Distance& distance) {
  const int x0 = std::max(0, static_cast<int>(std::floor(low.x() - reach)) - 1);
  const int y0 = std::max(0, static_cast<int>(std::floor(low.y() - reach)) - 1);
  const int x1 = std::min(image->width - 1, static_cast<int>(std::ceil(high.x() + reach)) + 1);
  const int y1 = std::min(image->height - 1, static_cast<int>(std::ceil(high.y() + reach)) + 1);
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const double covered = std::clamp(reach - distance(Vec2d(x + 0.5, y + 0.5)) + 0.5, 0.0, 1.0);
      for (int c = 0; covered > 0 && c < 3; ++c) {
        uint8_t& value = image->Pixel(x, y)[c];
        value = static_cast<uint8_t>(std::lround(value + covered * (color[c] - value)));
      }
    }
  }
}

void PaintSegment(const Vec2d& a, const Vec2d& b, double width, const Rgb8& color, Image8* image) {
  Paint(image, a.cwiseMin(b), a.cwiseMax(b), width / 2, color,
        [&](const Vec2d& p) { return DistanceToSegment(p, a, b); });
}

void Rasterize(const DrawnLine& line, double scale, Image8* image) {
  double phase = 0;  // how far into a dash and its gap the line is
  for (size_t i = 0; i + 1 < line.points.size(); ++i) {
    const Vec2d a = line.points[i], b = line.points[i + 1];
    if (!line.dashed) {
      PaintSegment(scale * a, scale * b, scale * line.width, line.color, image);
      continue;
    }
    const double length = (b - a).norm();
    for (double from = 0; from < length;) {
      const bool on = phase < kDash;
      // At least a little, so that what rounding leaves of a step ends.
      const double left = std::max(1e-6, (on ? kDash : kDash + kGapInDash) - phase);
      const double to = std::min(length, from + left);
      const auto point = [&](double along) { return Vec2d(scale * (a + along / length * (b - a))); };
      if (on) PaintSegment(point(from), point(to), scale * line.width, line.color, image);
      phase = std::fmod(phase + to - from, kDash + kGapInDash);
      from = to;
    }
  }
}

void Rasterize(const DrawnDisc& disc, double scale, Image8* image) {
  const Vec2d centre = scale * disc.centre;
  const double radius = scale * disc.radius;
  if (disc.ring > 0) {
    const Vec2d reach = Vec2d::Constant(radius);
    Paint(image, centre - reach, centre + reach, scale * disc.ring / 2, disc.color,
          [&](const Vec2d& p) { return std::abs((p - centre).norm() - radius); });
  } else {
    Paint(image, centre, centre, radius, disc.color, [&](const Vec2d& p) { return (p - centre).norm(); });
  }
}

void Rasterize(const DrawnBox& box, double scale, Image8* image) {
  const Vec2d middle = scale / 2 * (box.low + box.high), half = scale / 2 * (box.high - box.low);
  Paint(image, middle - half, middle + half, 0, box.color,
        [&](const Vec2d& p) { return ((p - middle).cwiseAbs() - half).maxCoeff(); });
}

void Rasterize(const DrawnText& text, double scale, Image8* image) {
  DrawText(image, static_cast<int>(std::lround(scale * text.at.x())),
           static_cast<int>(std::lround(scale * text.at.y())),
           static_cast<int>(std::lround(scale * text.size)), text.text, text.color, text.align);
}

}  // namespace

void Place(const Drawing& drawing, double x, double y, Drawing* page) {
  const Vec2d corner(x, y);
  for (Shape shape : drawing.shapes) {
    std::visit(Overloaded{[&](DrawnLine& line) {
                            for (Vec2d& point : line.points) point += corner;
                          },
                          [&](DrawnDisc& disc) { disc.centre += corner; },
                          [&](DrawnBox& box) {
                            box.low += corner;
                            box.high += corner;
                          },
                          [&](DrawnText& text) { text.at += corner; }},
               shape);
    page->shapes.push_back(std::move(shape));
  }
}

std::string ToSvg(const Drawing& drawing) {
  std::string svg = fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" width="{0:g}" height="{1:g}" viewBox="0 0 {0:g} {1:g}" )"
      R"(font-family="DejaVu Sans, Helvetica, sans-serif"><rect width="100%" height="100%" fill="white"/>)",
      drawing.width, drawing.height);
  for (const Shape& shape : drawing.shapes) {
    svg += "\n" + std::visit([](const auto& one) { return Svg(one); }, shape);
  }
  return svg + "\n</svg>\n";
}

Image8 ToImage(const Drawing& drawing, double scale) {
  Image8 image(static_cast<int>(std::ceil(scale * drawing.width)),
               static_cast<int>(std::ceil(scale * drawing.height)), 3, 255);
  for (const Shape& shape : drawing.shapes) {
    std::visit([&](const auto& one) { Rasterize(one, scale, &image); }, shape);
  }
  return image;
}

double TextWidth(const std::string& text, double size) {
  const auto letters = std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; });
  return 0.57 * size * static_cast<double>(letters);
}

void WritePictures(const Drawing& drawing, const std::filesystem::path& folder, const std::string& name) {
  WriteFile(folder / (name + ".svg"), ToSvg(drawing));
  WriteImage(folder / (name + ".png"), ToImage(drawing));
}

}  // namespace lumen
