#include "server/http/negotiate.h"

#include <charconv>
#include <vector>

namespace gonio::http {
namespace {

struct MediaRange {
    std::string_view type;  // "text/csv", "text/*" or "*/*"
    double quality = 1;
};

std::vector<MediaRange> parse_accept(std::string_view accept) {
    std::vector<MediaRange> ranges;
    for (const std::string_view part : split_list(accept, ',')) {
        const auto fields = split_list(part, ';');
        if (fields.empty()) continue;
        MediaRange range{fields[0]};
        for (const std::string_view field : std::span(fields).subspan(1)) {
            if (!equal_ignoring_case(field.substr(0, 2), "q=")) continue;
            const std::string_view digits = field.substr(2);
            // What is no number from 0 to 1 wants nothing.
            if (std::from_chars(digits.data(), digits.data() + digits.size(), range.quality).ec !=
                    std::errc() ||
                !(range.quality >= 0 && range.quality <= 1)) {
                range.quality = 0;
            }
        }
        ranges.push_back(range);
    }
    return ranges;
}

// 3 for the type itself, 2 for its family, 1 for anything, 0 for no match.
int specificity(std::string_view range, std::string_view type) {
    if (equal_ignoring_case(range, type)) return 3;
    if (range == "*/*") return 1;
    const size_t slash = type.find('/');
    return range.ends_with("/*") &&
                   equal_ignoring_case(range.substr(0, range.size() - 2), type.substr(0, slash))
               ? 2
               : 0;
}

// The quality that the most specific range gives: "text/csv;q=0, */*" wants anything but CSV.
double quality_of(const std::string& type, const std::vector<MediaRange>& ranges) {
    double quality = 0;
    int best = 0;
    for (const MediaRange& range : ranges) {
        if (const int how = specificity(range.type, type); how > best) {
            best = how;
            quality = range.quality;
        }
    }
    return quality;
}

}  // namespace

std::optional<size_t> negotiate(std::string_view accept, std::string_view name,
                                std::span<const Choice> choices) {
    if (!name.empty()) {
        for (size_t i = 0; i < choices.size(); ++i) {
            if (choices[i].name == name) return i;
        }
        return std::nullopt;
    }
    if (trimmed(accept).empty()) accept = "*/*";
    const std::vector<MediaRange> ranges = parse_accept(accept);
    std::optional<size_t> best;
    double best_quality = 0;
    for (size_t i = 0; i < choices.size(); ++i) {
        if (const double quality = quality_of(choices[i].media_type, ranges); quality > best_quality) {
            best_quality = quality;
            best = i;
        }
    }
    return best;
}

Problem not_acceptable(std::span<const Choice> choices) {
    Problem problem;
    problem.status = 406;
    problem.detail = "there is:";
    for (const Choice& choice : choices) {
        problem.detail += " " + choice.media_type + " (?f=" + choice.name + ")";
    }
    return problem;
}

}  // namespace gonio::http
