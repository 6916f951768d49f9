// A sheet to draw on: the few strokes that figures need, over cairo, which is named in canvas.cpp alone.
// Units are points, origin at the top left, y down.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace gonio {

struct Colour {
    double r = 0, g = 0, b = 0;
};

struct Point {
    double x = 0, y = 0;
};

enum class Align { left, centre, right };

class Canvas {
  public:
    struct Implementation;
    explicit Canvas(Implementation& implementation) : cairo_(implementation) {}

    void line(const std::vector<Point>& points, Colour colour, double width = 1, bool is_dashed = false,
              double alpha = 1);
    void polygon(const std::vector<Point>& points, Colour colour, double alpha = 1);
    void circle(Point centre, double radius, Colour colour, double width);  // outline
    void disk(Point centre, double radius, Colour colour);                  // filled
    // Arc counter-clockwise from angle a to b, radians from +x with y up, as on paper.
    void arc(Point centre, double radius, double a, double b, Colour colour, double width);
    void arrow(Point from, Point to, Colour colour, double width);
    // y is the middle of the letters' height; angle in radians, counter-clockwise.
    void text(Point at, const std::string& words, double size, Colour colour, Align align = Align::left,
              bool bold = false, double angle = 0);
    double text_width(const std::string& words, double size, bool bold = false);
    // width * height pixels 0xAARRGGBB (premultiplied), drawn over the rectangle.
    void image(const std::vector<uint32_t>& pixels, int width, int height, Point corner, double w, double h);

  private:
    Implementation& cairo_;
};

// Draws a white sheet of the given size to an SVG or PNG file (PNG at two pixels a point), by the extension
// of `path`.
void draw_figure(const std::string& path, double width, double height,
                 const std::function<void(Canvas&)>& draw);

}  // namespace gonio
