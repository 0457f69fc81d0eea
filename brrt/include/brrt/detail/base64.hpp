// The cells of a grid as brrt's worlds have them: bits, in a zlib stream, in base64.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace brrt::detail {

/// Return truth values as bits, the first one highest.
inline std::string packed(const std::vector<bool> &values) {
    std::string bytes((values.size() + 7) / 8, '\0');
    for (std::size_t i = 0; i < values.size(); ++i)
        if (values[i]) bytes[i / 8] = static_cast<char>(bytes[i / 8] | 0x80 >> i % 8);
    return bytes;
}

/// Return bytes as a zlib stream that does not compress them (RFC 1950 and 1951).
inline std::string zlib_stored(std::string_view data) {
    std::string stream = "\x78\x01";
    std::uint32_t a = 1, b = 0;
    for (const char c : data) {
        a = (a + static_cast<std::uint8_t>(c)) % 65521;
        b = (b + a) % 65521;
    }
    do {
        const std::string_view part = data.substr(0, 65535);
        data.remove_prefix(part.size());
        stream += data.empty() ? '\1' : '\0';
        const auto size = static_cast<std::uint32_t>(part.size());
        for (const std::uint32_t n : {size, ~size}) {
            stream += static_cast<char>(n & 255);
            stream += static_cast<char>(n >> 8 & 255);
        }
        stream += part;
    } while (!data.empty());
    for (const std::uint32_t n : {b >> 8, b, a >> 8, a}) stream += static_cast<char>(n & 255);
    return stream;
}

/// Return bytes as base64 (RFC 4648).
inline std::string base64(std::string_view data) {
    constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (std::size_t at = 0; at < data.size(); at += 3) {
        std::uint32_t bits = 0;
        for (std::size_t k = 0; k < 3; ++k)
            bits =
                bits << 8 | (at + k < data.size() ? static_cast<std::uint8_t>(data[at + k]) : 0u);
        for (std::size_t k = 0; k < 4; ++k)
            text += at + k > data.size() ? '=' : kDigits[bits >> (18 - 6 * k) & 63];
    }
    return text;
}

}  // namespace brrt::detail
