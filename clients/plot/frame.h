// A rectangular diagram: box, grid, ticks, labels.
#pragma once
#include "clients/plot/axis.h"
#include "clients/plot/canvas.h"

namespace gonio {

struct Frame {
    Point corner;  // top left
    double width = 0, height = 0;
    Scale x, y;

    Point at(double x_value, double y_value) const {
        return {corner.x + x.place(x_value) * width, corner.y + (1 - y.place(y_value)) * height};
    }
    void draw(Canvas& canvas, const std::string& x_label, const std::string& y_label) const;
};

}  // namespace gonio
