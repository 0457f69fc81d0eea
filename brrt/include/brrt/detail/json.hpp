// Text as JSON has it, and as Python's json.dumps writes it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

namespace brrt::detail {

/// Return a finite number with as many digits as bring the same one back.
inline std::string json(double x) {
    char text[32] = {};
    std::snprintf(text, sizeof text, "%.17g", x);
    for (char &c : text)
        if (c == ',') c = '.';  // the decimal point of some locales
    return text;
}

/// Return the numbers in a range as a list.
inline std::string json(const double *begin, std::size_t count) {
    std::string text = "[";
    for (std::size_t i = 0; i < count; ++i) text += (i ? ", " : "") + json(begin[i]);
    return text + "]";
}

/// Return the next character of a UTF-8 text and step over it; U+FFFD for what is none.
inline std::uint32_t next_character(std::string_view text, std::size_t &at) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const std::uint32_t first = byte(at++);
    if (first < 0x80) return first;
    const std::size_t more = first >= 0xF0 ? 3 : first >= 0xE0 ? 2 : first >= 0xC2 ? 1 : 0;
    if (more == 0 || first > 0xF4) return 0xFFFD;
    std::uint32_t found = first & (0x3Fu >> more);
    for (std::size_t i = 0; i < more; ++i) {
        if (at == text.size() || (byte(at) & 0xC0) != 0x80) return 0xFFFD;
        found = found << 6 | (byte(at++) & 0x3Fu);
    }
    const bool too_long = found < (more == 3 ? 0x10000u : more == 2 ? 0x800u : 0x80u);
    return too_long || found > 0x10FFFF || (found >= 0xD800 && found < 0xE000) ? 0xFFFD : found;
}

/// Return a text as a JSON string in ASCII.
inline std::string json_text(std::string_view text) {
    std::string found = "\"";
    const auto escaped = [&](std::uint32_t unit) {
        char code[8];
        std::snprintf(code, sizeof code, "\\u%04x", static_cast<unsigned>(unit & 0xFFFF));
        found += code;
    };
    for (std::size_t at = 0; at < text.size();) {
        const std::uint32_t c = next_character(text, at);
        if (c == '"' || c == '\\') (found += '\\') += static_cast<char>(c);
        else if (c == '\n') found += "\\n";
        else if (c == '\r') found += "\\r";
        else if (c == '\t') found += "\\t";
        else if (c == '\b') found += "\\b";
        else if (c == '\f') found += "\\f";
        else if (c >= 0x20 && c < 0x7F) found += static_cast<char>(c);
        else if (c < 0x10000) escaped(c);
        else escaped(0xD7C0 + (c >> 10)), escaped(0xDC00 + (c & 0x3FF));
    }
    return found + '"';
}

/// Return a text in UTF-8 whatever it is: readers refuse anything else.
inline std::string utf8(std::string_view text) {
    std::string found;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t begin = at;
        const bool whole = next_character(text, at) != 0xFFFD;
        found += whole ? text.substr(begin, at - begin) : std::string_view("\xEF\xBF\xBD");
    }
    return found;
}

}  // namespace brrt::detail
