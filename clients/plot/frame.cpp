#include "clients/plot/frame.h"

#include "base/numeric.h"
#include "clients/plot/palette.h"

namespace gonio {

void Frame::draw(Canvas& canvas, const std::string& x_label, const std::string& y_label) const {
    const double right = corner.x + width, bottom = corner.y + height;
    for (const double value : ticks(x, 8)) {
        const double px = at(value, y.low).x;
        canvas.line({{px, corner.y}, {px, bottom}}, pale, 0.7);
        canvas.text({px, bottom + 12}, tick_label(value), 10.5, ink, Align::centre);
    }
    for (const double value : ticks(y, 8)) {
        const double py = at(x.low, value).y;
        canvas.line({{corner.x, py}, {right, py}}, pale, 0.7);
        canvas.text({corner.x - 6, py}, tick_label(value), 10.5, ink, Align::right);
    }
    canvas.line({{corner.x, corner.y}, {corner.x, bottom}, {right, bottom}}, ink, 1);
    canvas.text({corner.x + 0.5 * width, bottom + 30}, x_label, 12, ink, Align::centre);
    canvas.text({corner.x - 56, corner.y + 0.5 * height}, y_label, 12, ink, Align::centre, false, pi / 2);
}

}  // namespace gonio
