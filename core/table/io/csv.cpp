// CSV: comment lines with '#', a header, one line a pair (and order). Slow to read for a machine, easy for
// everybody else.
#include <cmath>
#include <unordered_map>

#include "base/error.h"
#include "table/io/formats.h"

namespace gonio {
namespace {

constexpr std::string_view angle_columns = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg";
// Behind them if the outgoing directions are cells.
constexpr std::string_view cell_columns =
    ",theta_o_min_deg,theta_o_max_deg,phi_o_min_deg,phi_o_max_deg,solid_angle_o_sr,projected_solid_angle_o_"
    "sr";

// Provenance is one line a key: line ends, backslashes and a key's colons are escaped so that they read back.
std::string escape(std::string_view text, bool is_key) {
    std::string escaped;
    for (const char c : text) {
        if (c == '\n')
            escaped += "\\n";
        else if (c == '\r')
            escaped += "\\r";
        else if (c == '\\')
            escaped += "\\\\";
        else if (c == ':' && is_key)
            escaped += "\\:";
        else
            escaped += c;
    }
    return escaped;
}

std::string unescape(std::string_view text) {
    std::string plain;
    for (size_t k = 0; k < text.size(); ++k) {
        if (text[k] != '\\' || k + 1 == text.size()) {
            plain += text[k];
            continue;
        }
        const char c = text[++k];
        plain += c == 'n' ? '\n' : c == 'r' ? '\r' : c;
    }
    return plain;
}

std::string angle_text(const AnglesDeg& a) {
    std::string text;
    append_number(text, a.theta_deg);
    text += ',';
    append_number(text, a.phi_deg);
    text += ',';
    return text;
}

std::vector<std::string> angle_texts(const std::vector<AnglesDeg>& directions) {
    std::vector<std::string> texts;
    texts.reserve(directions.size());
    for (const AnglesDeg& a : directions) texts.push_back(angle_text(a));
    return texts;
}

std::string cell_text(const ReceiverCell& cell) {
    std::string text;
    for (const double value : {cell.theta_min_deg, cell.theta_max_deg, cell.phi_min_deg, cell.phi_max_deg,
                               solid_angle(cell), projected_solid_angle(cell)}) {
        append_number(text, value);
        text += ',';
    }
    return text;
}

}  // namespace

void write_csv(const Table& table, std::ostream& out) {
    BlockWriter writer(out);
    writer.text() += "# gonio table, version " + std::to_string(table_format_version) + "\n";
    for (const std::string_view line : table_conventions)
        writer.text().append("# ").append(line).append("\n");
    if (!table.cells.empty()) writer.text().append("# ").append(cell_convention).append("\n");
    if (table.orders > 0)
        writer.text() += "# order: 0 is the sum of all orders, k the k-th order of scattering alone\n";
    writer.text() += "# provenance\n";
    for (const auto& [key, value] : table.provenance)
        writer.text() += "# " + escape(key, true) + ": " + escape(value, false) + "\n";

    writer.text() += angle_columns;
    if (!table.cells.empty()) writer.text() += cell_columns;
    if (table.orders > 0) writer.text() += ",order";
    for (const std::string& name : table.channels)
        writer.text() += ",f_" + name + ",se_" + name + ",bias_" + name;
    writer.text() += "\n";

    const std::vector<std::string> incident = angle_texts(table.incident);
    std::vector<std::string> outgoing = angle_texts(table.outgoing);
    for (size_t o = 0; o < table.cells.size(); ++o) outgoing[o] += cell_text(table.cells[o]);
    for (size_t row = 0; row < table.rows(); ++row) {
        const auto [i, o] = table.pair(row);
        for (size_t slice = 0; slice < table.slices(); ++slice) {
            std::string& text = writer.text();
            text += incident[i];
            text += outgoing[o];
            if (table.orders > 0) {
                append_number(text, slice);
                text += ',';
            }
            for (size_t channel = 0; channel < table.channels.size(); ++channel) {
                const size_t k = table.index(channel, slice, row);
                append_number(text, table.f[k]);
                text += ',';
                append_number(text, table.se[k]);
                text += ',';
                append_number(text, table.bias[k]);
                text += ',';
            }
            text.back() = '\n';
        }
    }
    writer.flush();
}

namespace {

// Walks lines and fields; every error names file and line.
class CsvReader {
  public:
    CsvReader(std::string_view text, const std::string& name) : text_(text), name_(name) {}

    [[noreturn]] void refuse(const std::string& value, const std::string& allowed) const {
        throw Error(ErrorCode::invalid_input, name_ + " line " + std::to_string(line_number_), value,
                    allowed);
    }

    bool next_line() {
        if (position_ >= text_.size()) return false;
        size_t end = text_.find('\n', position_);
        if (end == std::string_view::npos) end = text_.size();
        line_ = text_.substr(position_, end - position_);
        if (line_.ends_with('\r')) line_.remove_suffix(1);
        position_ = end + 1;
        ++line_number_;
        return true;
    }
    std::string_view line() const { return line_; }
    size_t bytes_left() const { return position_ < text_.size() ? text_.size() - position_ : 0; }

    template <class Number>
    Number number() {
        Number value{};
        const auto [end, error] = std::from_chars(line_.data(), line_.data() + line_.size(), value);
        if (error != std::errc() || !std::isfinite(static_cast<double>(value)))
            refuse("\"" + std::string(line_.substr(0, line_.find(','))) + "\"",
                   "a finite number is needed here");
        line_.remove_prefix(end - line_.data());
        if (!line_.empty()) {
            if (line_[0] != ',')
                refuse("\"" + std::string(line_.substr(0, 20)) + "\"", "a comma is needed here");
            line_.remove_prefix(1);
            if (line_.empty()) refuse("", "the line ends in a comma");
        }
        return value;
    }

  private:
    std::string_view text_, line_;
    const std::string& name_;
    size_t position_ = 0, line_number_ = 0;
};

// Gives each new direction the next index.
class DirectionIndex {
  public:
    explicit DirectionIndex(std::vector<AnglesDeg>& list) : list_(list) {}
    int operator()(const AnglesDeg& a) {
        if (!list_.empty() && list_[last_] == a) return last_;  // rows come in runs
        const auto [entry, is_new] = indices_.try_emplace(a, static_cast<int>(list_.size()));
        if (is_new) list_.push_back(a);
        return last_ = entry->second;
    }

  private:
    struct Hash {
        size_t operator()(const AnglesDeg& a) const {
            return std::hash<double>()(a.theta_deg) * 0x9e3779b97f4a7c15u ^ std::hash<double>()(a.phi_deg);
        }
    };
    std::vector<AnglesDeg>& list_;
    std::unordered_map<AnglesDeg, int, Hash> indices_;
    int last_ = 0;
};

void read_comments(CsvReader& reader, Table& table) {
    bool in_provenance = false;
    while (reader.next_line()) {
        std::string_view line = reader.line();
        if (line.empty()) continue;
        if (line[0] != '#') return;
        line.remove_prefix(1);
        if (line.starts_with(' ')) line.remove_prefix(1);
        if (line.starts_with("gonio table, version ")) {
            const std::string_view version = line.substr(line.rfind(' ') + 1);
            if (version != std::to_string(table_format_version))
                reader.refuse("\"" + std::string(version) + "\"", "this program reads version 1");
        } else if (line == "provenance") {
            in_provenance = true;
        } else if (in_provenance) {
            size_t colon = line.find(": ");
            while (colon != std::string_view::npos && colon > 0 && line[colon - 1] == '\\')
                colon = line.find(": ", colon + 1);
            if (colon == std::string_view::npos) continue;  // a remark of somebody's
            table.provenance.emplace_back(unescape(line.substr(0, colon)), unescape(line.substr(colon + 2)));
        }
    }
    reader.refuse("", "the file ends before the header " + std::string(angle_columns));
}

struct Header {
    bool has_cells = false, has_orders = false;
};

// Fills channels.
Header read_header(const CsvReader& reader, Table& table) {
    std::string_view header = reader.line();
    if (!header.starts_with(angle_columns))
        reader.refuse("", "the header must begin with " + std::string(angle_columns));
    header.remove_prefix(angle_columns.size());
    Header found;
    found.has_cells = header.starts_with(cell_columns);
    if (found.has_cells) header.remove_prefix(cell_columns.size());
    found.has_orders = header.starts_with(",order,");
    if (found.has_orders) header.remove_prefix(6);
    while (!header.empty()) {
        if (!header.starts_with(",f_"))
            reader.refuse("\"" + std::string(header.substr(0, 40)) + "\"", "expected ,f_NAME");
        header.remove_prefix(3);
        const std::string name(header.substr(0, header.find(',')));
        const std::string group = name + ",se_" + name + ",bias_" + name;
        const bool complete =
            header.starts_with(group) && (header.size() == group.size() || header[group.size()] == ',');
        if (name.empty() || !complete)
            reader.refuse("\"" + name + "\"", "f_NAME must be followed by se_NAME,bias_NAME");
        header.remove_prefix(group.size());
        table.channels.push_back(name);
    }
    if (table.channels.empty()) reader.refuse("", "the table has no channel");
    return found;
}

// The rows are a full product if they run through every outgoing direction for each incident one, in order.
bool is_product(const Table& table) {
    if (table.pairs.size() != table.incident.size() * table.outgoing.size()) return false;
    for (size_t row = 0; row < table.pairs.size(); ++row) {
        const std::pair<int, int> expected(static_cast<int>(row / table.outgoing.size()),
                                           static_cast<int>(row % table.outgoing.size()));
        if (table.pairs[row] != expected) return false;
    }
    return true;
}

// file order [row][slice][channel] -> [channel][slice][row]
std::vector<float> transpose(const std::vector<float>& values, const Table& table, size_t offset) {
    const size_t n_channels = table.channels.size(), slices = table.slices(), rows = table.rows();
    std::vector<float> result(n_channels * slices * rows);
    for (size_t row = 0, k = offset; row < rows; ++row)
        for (size_t slice = 0; slice < slices; ++slice)
            for (size_t channel = 0; channel < n_channels; ++channel, k += 3)
                result[table.index(channel, slice, row)] = values[k];
    return result;
}

}  // namespace

Table parse_csv(std::string_view text, const std::string& name) {
    Table table;
    CsvReader reader(text, name);
    read_comments(reader, table);
    const auto [has_cells, has_orders] = read_header(reader, table);
    const size_t n_values = 3 * table.channels.size();

    std::vector<float> values;
    values.reserve(reader.bytes_left() / 8);
    DirectionIndex incident(table.incident), outgoing(table.outgoing);
    int slice = 0, last_slice = has_orders ? -1 : 0;  // -1: not known before the second pair begins
    while (reader.next_line()) {
        if (reader.line().empty()) continue;
        AnglesDeg wi, wo;
        wi.theta_deg = reader.number<double>();
        wi.phi_deg = reader.number<double>();
        wo.theta_deg = reader.number<double>();
        wo.phi_deg = reader.number<double>();
        const std::pair<int, int> pair(incident(wi), outgoing(wo));
        if (has_cells) {
            ReceiverCell cell;
            for (double* bound :
                 {&cell.theta_min_deg, &cell.theta_max_deg, &cell.phi_min_deg, &cell.phi_max_deg})
                *bound = reader.number<double>();
            for (int k = 0; k < 2; ++k) reader.number<double>();  // the solid angles follow from the bounds
            if (table.cells.size() < table.outgoing.size()) table.cells.push_back(cell);
            if (cell != table.cells[pair.second]) reader.refuse("", "two cells have the same centre");
        }
        if (has_orders) {
            const int order = reader.number<int>();
            if (order == 0 && slice > 0 && last_slice < 0) last_slice = slice - 1, slice = 0;
            if (order != slice)
                reader.refuse(std::to_string(order), "orders must run 0, 1, ..., K for each pair");
        }
        if (slice == 0) {
            table.pairs.push_back(pair);
        } else if (pair != table.pairs.back()) {
            reader.refuse("", "the directions changed before the last order of the pair");
        }
        for (size_t k = 0; k < n_values; ++k) {
            if (reader.line().empty()) reader.refuse("", "the line is too short");
            values.push_back(reader.number<float>());
        }
        if (!reader.line().empty())
            reader.refuse("\"" + std::string(reader.line().substr(0, 20)) + "\"", "the line is too long");
        slice = slice == last_slice ? 0 : slice + 1;
    }
    if (table.pairs.empty()) reader.refuse("", "the table has no rows");
    if (last_slice < 0) last_slice = slice - 1, slice = 0;  // a single pair
    if (slice != 0) reader.refuse("", "the file ends before the last order of the last pair");
    table.orders = last_slice;
    if (is_product(table)) table.pairs.clear();
    table.f = transpose(values, table, 0);
    table.se = transpose(values, table, 1);
    table.bias = transpose(values, table, 2);
    validate(table);
    return table;
}

}  // namespace gonio
