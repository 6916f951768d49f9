// JSON: a table that explains itself. The structure goes through nlohmann::json; the three long arrays are
// streamed, because a DOM of them would need 16 bytes a value.
//   { "format": "gonio-table", "version": 1, "quantity": {...}, "conventions": [...], "provenance": [[key,
//   value], ...],
//     "axes": [...], "pairs": [[i, o], ...] or null, "shape": [...],
//     "values": [...], "standard_error": [...], "bias": [...] }
// The arrays are flat, last axis fastest; shape is [channels, orders, incident, outgoing] or, with pairs,
// [channels, orders, pairs]. Readers skip members they do not know and refuse versions they do not know.
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "table/io/formats.h"

namespace gonio {
namespace {

constexpr const char* format_name = "gonio-table";

nlohmann::ordered_json direction_axis(const std::string& name, const std::vector<AnglesDeg>& directions) {
    nlohmann::ordered_json values = nlohmann::ordered_json::array();
    for (const AnglesDeg& a : directions) values.push_back({a.theta_deg, a.phi_deg});
    return {{"name", name}, {"unit", "deg"}, {"columns", {"theta", "phi"}}, {"values", std::move(values)}};
}

// The outgoing axis of a table over cells has, beside its centres, their bounds and sizes.
nlohmann::ordered_json cell_member(const std::vector<ReceiverCell>& cells) {
    nlohmann::ordered_json bounds = nlohmann::ordered_json::array(), sizes = bounds, projected = bounds;
    for (const ReceiverCell& c : cells) {
        bounds.push_back({c.theta_min_deg, c.theta_max_deg, c.phi_min_deg, c.phi_max_deg});
        sizes.push_back(solid_angle(c));
        projected.push_back(projected_solid_angle(c));
    }
    return {{"unit", "deg"},
            {"columns", {"theta_min", "theta_max", "phi_min", "phi_max"}},
            {"values", std::move(bounds)},
            {"solid_angle_sr", std::move(sizes)},
            {"projected_solid_angle_sr", std::move(projected)}};
}

nlohmann::ordered_json order_axis(const Table& table) {
    std::vector<int> values;
    for (int k = 0; k <= table.orders; ++k) values.push_back(k);
    return {{"name", "order"},
            {"unit", "1"},
            {"meaning", "0: the sum of all orders; k: the k-th order of scattering alone"},
            {"values", values}};
}

nlohmann::ordered_json head(const Table& table) {
    nlohmann::ordered_json root;
    root["format"] = format_name;
    root["version"] = table_format_version;
    root["quantity"] = {{"name", "f"}, {"meaning", "BRDF f_r, no cosine inside"}, {"unit", "1/sr"}};
    for (const std::string_view line : table_conventions) root["conventions"].push_back(line);
    if (!table.cells.empty()) root["conventions"].push_back(cell_convention);
    root["provenance"] = nlohmann::ordered_json::array();
    for (const auto& [key, value] : table.provenance) root["provenance"].push_back({key, value});
    root["axes"] = {{{"name", "channel"}, {"unit", ""}, {"values", table.channels}},
                    order_axis(table),
                    direction_axis("incident", table.incident),
                    direction_axis("outgoing", table.outgoing)};
    if (!table.cells.empty()) root["axes"].back()["cells"] = cell_member(table.cells);
    root["shape"] = {table.channels.size(), table.slices()};
    if (table.pairs.empty()) {
        root["pairs"] = nullptr;
        root["shape"].push_back(table.incident.size());
        root["shape"].push_back(table.outgoing.size());
    } else {
        root["pairs"] = table.pairs;
        root["shape"].push_back(table.pairs.size());
    }
    return root;
}

void append_array(BlockWriter& writer, const char* member, const std::vector<float>& values) {
    writer.text().append(",\n\"").append(member).append("\": [");
    for (size_t k = 0; k < values.size(); ++k) {
        if (k > 0) writer.text() += k % 16 == 0 ? ",\n" : ",";
        append_number(writer.text(), values[k]);
    }
    writer.text() += "]";
}

}  // namespace

void write_json(const Table& table, std::ostream& out) {
    BlockWriter writer(out);
    // Users' strings may hold anything; bytes that are not UTF-8 are replaced rather than fatal at the end of
    // a long run.
    std::string text = head(table).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    text.pop_back();  // the closing brace comes after the arrays
    writer.text() += text;
    append_array(writer, "values", table.f);
    append_array(writer, "standard_error", table.se);
    append_array(writer, "bias", table.bias);
    writer.text() += "}\n";
    writer.flush();
}

namespace {

using Json = nlohmann::json;

class JsonReader {
  public:
    JsonReader(const Json& root, const std::string& name) : root_(root), name_(name) {}

    [[noreturn]] void refuse(const std::string& pointer, const std::string& value,
                             const std::string& allowed) const {
        throw Error(ErrorCode::invalid_input, name_ + " " + pointer, value, allowed);
    }
    const Json& member(const char* key, Json::value_t type) const {
        const auto found = root_.find(key);
        if (found == root_.end()) refuse(std::string("/") + key, "", "is missing");
        if (found->type() != type) refuse(std::string("/") + key, found->type_name(), "is of the wrong type");
        return *found;
    }
    std::vector<float> floats(const char* key) const {
        const Json& array = member(key, Json::value_t::array);
        std::vector<float> values;
        values.reserve(array.size());
        for (const Json& value : array) {
            if (!value.is_number()) refuse(std::string("/") + key, value.type_name(), "numbers are needed");
            const double number = value.get<double>();
            // Past the largest float the cast would be undefined; validate() refuses the infinity.
            values.push_back(std::abs(number) > std::numeric_limits<float>::max()
                                 ? std::numeric_limits<float>::infinity()
                                 : static_cast<float>(number));
        }
        return values;
    }
    const Json& axis_object(const std::string& axis_name) const {
        for (const Json& candidate : member("axes", Json::value_t::array)) {
            if (!candidate.is_object() || candidate.value("name", Json()) != axis_name) continue;
            const auto values = candidate.find("values");
            if (values != candidate.end() && values->is_array()) return candidate;
        }
        refuse("/axes", axis_name, "an axis of this name with an array of values is needed");
    }
    const Json& axis(const std::string& axis_name) const { return axis_object(axis_name)["values"]; }
    std::vector<AnglesDeg> directions(const std::string& axis_name) const {
        std::vector<AnglesDeg> list;
        for (const Json& a : axis(axis_name)) {
            if (!a.is_array() || a.size() != 2 || !a[0].is_number() || !a[1].is_number())
                refuse("/axes/" + axis_name, a.dump().substr(0, 40), "[theta, phi] in degrees is needed");
            list.push_back({a[0].get<double>(), a[1].get<double>()});
        }
        return list;
    }
    std::vector<ReceiverCell> cells() const {
        const Json& outgoing = axis_object("outgoing");
        const auto found = outgoing.find("cells");
        if (found == outgoing.end()) return {};
        const Json bounds = found->is_object() ? found->value("values", Json()) : Json();
        if (!bounds.is_array())
            refuse("/axes/outgoing/cells", "", "an object with an array of values is needed");
        std::vector<ReceiverCell> list;
        for (const Json& b : bounds) {
            if (!b.is_array() || b.size() != 4 || !b[0].is_number() || !b[1].is_number() ||
                !b[2].is_number() || !b[3].is_number())
                refuse("/axes/outgoing/cells", b.dump().substr(0, 40),
                       "[theta_min, theta_max, phi_min, phi_max] in degrees is needed");
            list.push_back({b[0].get<double>(), b[1].get<double>(), b[2].get<double>(), b[3].get<double>()});
        }
        return list;
    }
    int index(const Json& value, const std::string& pointer) const {
        if (!value.is_number_unsigned() || value.get<uint64_t>() > std::numeric_limits<int>::max())
            refuse(pointer, value.dump().substr(0, 40), "a whole number from 0 is needed");
        return value.get<int>();
    }

  private:
    const Json& root_;
    const std::string& name_;
};

}  // namespace

Table parse_json(std::string_view text, const std::string& name) {
    const Json root = Json::parse(text, nullptr, false);
    if (root.is_discarded() || !root.is_object())
        throw Error(ErrorCode::invalid_input, name, "", "not valid JSON");
    const JsonReader reader(root, name);
    const Json& format = reader.member("format", Json::value_t::string);
    if (format != format_name) reader.refuse("/format", format.dump(), format_name);
    const int version = reader.index(reader.member("version", Json::value_t::number_unsigned), "/version");
    if (version != table_format_version)
        reader.refuse("/version", std::to_string(version), "this program reads version 1");

    Table table;
    for (const Json& entry : reader.member("provenance", Json::value_t::array)) {
        if (!entry.is_array() || entry.size() != 2 || !entry[0].is_string() || !entry[1].is_string())
            reader.refuse("/provenance", entry.dump().substr(0, 40), "[key, value] is needed");
        table.provenance.emplace_back(entry[0].get<std::string>(), entry[1].get<std::string>());
    }
    for (const Json& channel : reader.axis("channel")) {
        if (!channel.is_string())
            reader.refuse("/axes/channel", channel.dump().substr(0, 40), "a name is needed");
        table.channels.push_back(channel.get<std::string>());
    }
    const size_t slices = reader.axis("order").size();
    if (slices < 1 || slices > std::numeric_limits<int>::max())
        reader.refuse("/axes/order", std::to_string(slices) + " values", "0, 1, ..., K");
    table.orders = static_cast<int>(slices) - 1;
    table.incident = reader.directions("incident");
    table.outgoing = reader.directions("outgoing");
    table.cells = reader.cells();
    if (root.contains("pairs") && !root["pairs"].is_null()) {
        for (const Json& pair : reader.member("pairs", Json::value_t::array)) {
            if (!pair.is_array() || pair.size() != 2)
                reader.refuse("/pairs", pair.dump().substr(0, 40), "[i, o]");
            table.pairs.emplace_back(reader.index(pair[0], "/pairs"), reader.index(pair[1], "/pairs"));
        }
    }
    table.f = reader.floats("values");
    table.se = reader.floats("standard_error");
    table.bias = reader.floats("bias");
    validate(table);
    return table;
}

}  // namespace gonio
