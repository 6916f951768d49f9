// Lengths as people write them: a number and a unit.
#pragma once
#include <string>
#include <string_view>

namespace gonio {

// "50 mm", "5um", "3e-6 m" -> metres. Units: km, m, cm, mm, um (also with either Unicode mu), nm, pm. `field`
// names the value in errors: Error(missing_unit) for a bare number, Error(invalid_input) for anything else,
// overflow and underflow included.
double parse_length(std::string_view text, const std::string& field);

// "km, m, cm, ...": for messages.
const std::string& length_units_text();

// Four significant digits in the unit that reads best: 3.906e-8 -> "39.06 nm".
std::string format_length(double metres);

}  // namespace gonio
