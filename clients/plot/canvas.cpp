#include "clients/plot/canvas.h"

#include <cairo-svg.h>
#include <cairo.h>

#include <cmath>
#include <filesystem>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/numeric.h"

namespace gonio {

struct Canvas::Implementation {
    cairo_t* context;

    void colour(Colour c, double alpha = 1) { cairo_set_source_rgba(context, c.r, c.g, c.b, alpha); }
    void font(double size, bool bold) {
        cairo_select_font_face(context, "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                               bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
        cairo_set_font_size(context, size);
    }
    void path(const std::vector<Point>& points) {
        cairo_new_path(context);
        for (const Point& p : points) cairo_line_to(context, p.x, p.y);
    }
};

void Canvas::line(const std::vector<Point>& points, Colour colour, double width, bool is_dashed,
                  double alpha) {
    const double dashes[] = {4 * width, 2.5 * width};
    cairo_.path(points);
    cairo_.colour(colour, alpha);
    cairo_set_line_width(cairo_.context, width);
    cairo_set_dash(cairo_.context, dashes, is_dashed ? 2 : 0, 0);
    cairo_stroke(cairo_.context);
    cairo_set_dash(cairo_.context, nullptr, 0, 0);
}

void Canvas::polygon(const std::vector<Point>& points, Colour colour, double alpha) {
    cairo_.path(points);
    cairo_close_path(cairo_.context);
    cairo_.colour(colour, alpha);
    cairo_fill(cairo_.context);
}

void Canvas::circle(Point centre, double radius, Colour colour, double width) {
    arc(centre, radius, 0, 2 * pi, colour, width);
}

void Canvas::disk(Point centre, double radius, Colour colour) {
    cairo_new_path(cairo_.context);
    cairo_arc(cairo_.context, centre.x, centre.y, radius, 0, 2 * pi);
    cairo_.colour(colour);
    cairo_fill(cairo_.context);
}

void Canvas::arc(Point centre, double radius, double a, double b, Colour colour, double width) {
    cairo_new_path(cairo_.context);
    cairo_arc_negative(cairo_.context, centre.x, centre.y, radius, -a, -b);
    cairo_.colour(colour);
    cairo_set_line_width(cairo_.context, width);
    cairo_stroke(cairo_.context);
}

void Canvas::arrow(Point from, Point to, Colour colour, double width) {
    const double length = std::hypot(to.x - from.x, to.y - from.y);
    if (length == 0) return;
    const double ux = (to.x - from.x) / length, uy = (to.y - from.y) / length, head = 4 * width;
    const Point neck{to.x - head * ux, to.y - head * uy};
    line({from, neck}, colour, width);
    polygon({to,
             {neck.x - 0.5 * head * uy, neck.y + 0.5 * head * ux},
             {neck.x + 0.5 * head * uy, neck.y - 0.5 * head * ux}},
            colour);
}

void Canvas::text(Point at, const std::string& words, double size, Colour colour, Align align, bool bold,
                  double angle) {
    cairo_.font(size, bold);
    const double width = text_width(words, size, bold);
    cairo_save(cairo_.context);
    cairo_translate(cairo_.context, at.x, at.y);
    cairo_rotate(cairo_.context, -angle);
    cairo_move_to(cairo_.context,
                  align == Align::left    ? 0
                  : align == Align::right ? -width
                                          : -0.5 * width,
                  0.36 * size);
    cairo_.colour(colour);
    cairo_show_text(cairo_.context, words.c_str());
    cairo_restore(cairo_.context);
}

double Canvas::text_width(const std::string& words, double size, bool bold) {
    cairo_.font(size, bold);
    cairo_text_extents_t extents;
    cairo_text_extents(cairo_.context, words.c_str(), &extents);
    return extents.x_advance;
}

void Canvas::image(const std::vector<uint32_t>& pixels, int width, int height, Point corner, double w,
                   double h) {
    // cairo wants its memory not const, and rows that it aligned itself; 32-bit pixels need no padding.
    auto* data = reinterpret_cast<unsigned char*>(const_cast<uint32_t*>(pixels.data()));
    cairo_surface_t* source =
        cairo_image_surface_create_for_data(data, CAIRO_FORMAT_ARGB32, width, height, 4 * width);
    cairo_save(cairo_.context);
    cairo_translate(cairo_.context, corner.x, corner.y);
    cairo_scale(cairo_.context, w / width, h / height);
    cairo_set_source_surface(cairo_.context, source, 0, 0);
    // Padded and cut, or the last pixels would fade into nothing.
    cairo_pattern_set_extend(cairo_get_source(cairo_.context), CAIRO_EXTEND_PAD);
    cairo_rectangle(cairo_.context, 0, 0, width, height);
    cairo_fill(cairo_.context);
    cairo_restore(cairo_.context);
    cairo_surface_destroy(source);
}

namespace {

constexpr double png_pixels_per_point = 2;

struct SurfaceOwner {
    cairo_surface_t* surface;
    ~SurfaceOwner() { cairo_surface_destroy(surface); }
};
struct ContextOwner {
    cairo_t* context;
    ~ContextOwner() { cairo_destroy(context); }
};

void check(cairo_status_t status, const std::string& path) {
    if (status != CAIRO_STATUS_SUCCESS)
        throw Error(ErrorCode::io, path, "",
                    std::string("cannot be drawn: ") + cairo_status_to_string(status));
}

}  // namespace

void draw_figure(const std::string& path, double width, double height,
                 const std::function<void(Canvas&)>& draw) {
    const std::string extension = std::filesystem::path(path).extension().string();
    const bool is_svg = extension == ".svg" || extension == ".SVG";
    if (!is_svg && extension != ".png" && extension != ".PNG")
        throw Error(ErrorCode::invalid_input, path, "\"" + extension + "\"", "figures are .svg or .png");
    write_path_atomically(path, [&](const std::string& temporary) {
        const double scale = is_svg ? 1 : png_pixels_per_point;
        const SurfaceOwner sheet{is_svg ? cairo_svg_surface_create(temporary.c_str(), width, height)
                                        : cairo_image_surface_create(CAIRO_FORMAT_RGB24,
                                                                     static_cast<int>(width * scale),
                                                                     static_cast<int>(height * scale))};
        check(cairo_surface_status(sheet.surface), path);
        {
            const ContextOwner owner{cairo_create(sheet.surface)};
            Canvas::Implementation implementation{owner.context};
            cairo_scale(owner.context, scale, scale);
            cairo_set_source_rgb(owner.context, 1, 1, 1);
            cairo_paint(owner.context);
            cairo_set_line_join(owner.context, CAIRO_LINE_JOIN_ROUND);
            Canvas canvas(implementation);
            draw(canvas);
            check(cairo_status(owner.context), path);
        }
        if (!is_svg) check(cairo_surface_write_to_png(sheet.surface, temporary.c_str()), path);
        cairo_surface_finish(sheet.surface);
        check(cairo_surface_status(sheet.surface), path);
    });
}

}  // namespace gonio
