/* The rows of a table (table.py), cell by cell. */
#pragma once
#include "../native/core.h"
#include "../native/records.h"
#include "bytes.h"

#define MANTISSA 100000000000000000 /* up to which digits are taken up; more of them only move the point */

INLINE int64_t line_end(BYTES text, int64_t i) {
    const uint8_t *end = i < text.size ? memchr(text.data + i, '\n', (size_t)(text.size - i)) : NULL;
    return end ? end - text.data : text.size;
}

/* 1 if a cell ends before this place. */
INLINE int ends(BYTES text, int64_t i, int64_t delimiter) {
    int c = byte_at(text, i);
    return c == NO_BYTE || c == delimiter || c == '\n' || c == '\r';
}

/* The end of an ignored cell; a delimiter in quotes is text. */
INLINE int64_t cell_end(BYTES text, int64_t i, int64_t delimiter) {
    int c, quoted = 0;
    for (; (c = byte_at(text, i)) != NO_BYTE && c != '\n' && c != '\r' && (quoted || c != delimiter); i++)
        quoted ^= c == '"';
    return i;
}

INLINE int64_t past_quotes(BYTES text, int64_t i) {
    int c;
    while ((c = byte_at(text, i)) == ' ' || c == '"')
        i++;
    return i;
}

/* The nearest whole number to mantissa times 10 to the power of shift, halves up; -1 if it is beyond LONGEST_NS. */
INLINE int64_t scaled(int64_t mantissa, int64_t shift) {
    int64_t divisor = 1;
    for (; shift > 0 && mantissa > 0 && mantissa < MANTISSA; shift--)
        mantissa *= 10;
    if (mantissa > 0 && (shift > 0 || (shift == 0 && mantissa > LONGEST_NS)))
        return -1;
    for (; shift < 0 && divisor < 10 * MANTISSA; shift++)
        divisor *= 10;
    return shift == 0 || mantissa == 0 ? (mantissa + divisor / 2) / divisor : 0;
}

/* The place after an exponent, and its value within 10 000; -1 if it has no digit. */
static int64_t exponent_at(BYTES text, int64_t i, int64_t *exponent) {
    int c = byte_at(text, i), down = c == '-';
    int64_t value = 0;
    i += down || c == '+';
    if (!is_digit(byte_at(text, i)))
        return -1;
    for (; is_digit(c = byte_at(text, i)); i++)
        value = least_of(10 * value + (c - '0'), 10000);
    *exponent = down ? -value : value;
    return i;
}

/* The place after a decimal number, and that number times 10 to the power of `power`, rounded to a whole one; -1 if it
   is no number, -2 if it is beyond LONGEST_NS. */
INLINE int64_t number_at(BYTES text, int64_t i, int64_t delimiter, int64_t power, int64_t *number) {
    i = past_quotes(text, i);
    int c = byte_at(text, i), negative = c == '-', good = 0, point = 0;
    int64_t mantissa = 0, exponent = 0;
    for (i += negative || c == '+';; i++) {
        if (is_digit(c = byte_at(text, i))) {
            good = 1;
            if (mantissa < MANTISSA) {
                mantissa = 10 * mantissa + (c - '0');
                power -= point;
            } else
                power += !point;
        } else if (!point && (c == '.' || (c == ',' && delimiter != ',')))
            point = 1;
        else
            break;
    }
    if (good && (c == 'E' || c == 'e'))
        i = exponent_at(text, i + 1, &exponent);
    i = good && i >= 0 ? past_quotes(text, i) : -1;
    if (i < 0 || !ends(text, i, delimiter))
        return -1;
    *number = scaled(mantissa, power + exponent);
    if (*number < 0)
        return -2;
    *number = negative ? -*number : *number;
    return i;
}

/* The place after a level, 0 or 1, perhaps in quotes or with zeros behind a point; -1 if the cell is no level. */
INLINE int64_t bit_at(BYTES text, int64_t i, int64_t delimiter, int *bit) {
    i = past_quotes(text, i);
    *bit = byte_at(text, i++) - '0';
    if (byte_at(text, i) == '.')
        do
            i++;
        while (byte_at(text, i) == '0');
    i = past_quotes(text, i);
    return (*bit == 0 || *bit == 1) && ends(text, i, delimiter) ? i : -1;
}

/* Write the changes of wanted columns from scan->place on, while there is room for a row; return their number. scan
   then says where and why it ended.

   columns [width]: IS_TIME, -1 ignored, else the signal. numbered: times are the numbers of samples. power: of ten,
   from the unit of time to ns. levels, first [signals]: present and first level (-1: none yet); times, which:
   output. */
API int64_t scan_table(A1(const uint8_t, data), int64_t delimiter, A1(const int16_t, columns), int64_t numbered,
                       int64_t power, R(SCAN, scan), A1(int8_t, levels, signals), A1(int8_t, first, signals),
                       A1(int64_t, times, n), A1(uint8_t, which, n)) {
    BYTES text = {data, data_n};
    CHANGES found = {times, which, times_n, 0};
    int64_t i = scan->place, line = scan->line, before = scan->time, rows = scan->rows;
    CHECK(i >= 0);
    while (i < data_n && found.count + columns_n + 2 <= found.room) { /* a change a column, a gap */
        int c = byte_at(text, i);
        if (c == '\n' || c == '\r' || c == ' ') {
            line += c == '\n';
            i++;
            continue;
        }
        if (c == ';' || c == '#' || (c == 'o' && begins(text, i, "overrun"))) {
            if (c == 'o' && !numbered) {
                scan->place = i, scan->line = line, scan->problem = NO_COUNT;
                return found.count;
            }
            i = line_end(text, i);
            continue;
        }
        int64_t row = i, begun = found.count, time = rows, column = 0;
        for (;; i++) {
            int64_t wanted = columns[column], start = i, problem = 0;
            int bit;
            if (wanted == IS_TIME) {
                i = number_at(text, i, delimiter, power, &time);
                problem = i == -1 ? NO_TIME : i == -2 ? TOO_LATE : rows && time < before ? EARLIER : 0;
                if (!rows)
                    scan->begin = time;
            } else if (wanted >= 0) {
                CHECK(wanted < levels_n);
                i = bit_at(text, i, delimiter, &bit);
                if (i < 0)
                    problem = NO_BIT;
                else if (levels[wanted] < 0)
                    first[wanted] = (int8_t)bit;
                else if (levels[wanted] != bit)
                    add_change(&found, 0, wanted);
                levels[wanted] = (int8_t)bit;
            } else
                i = cell_end(text, i, delimiter);
            if (problem) {
                scan->place = start, scan->line = line, scan->problem = problem, scan->column = column;
                return found.count;
            }
            if (++column == columns_n || byte_at(text, i) != delimiter)
                break;
        }
        if (column < columns_n) {
            scan->place = row, scan->line = line, scan->problem = SHORT_ROW;
            return found.count;
        }
        for (int64_t k = begun; k < found.count; k++)
            times[k] = time;
        if (numbered && rows && time > before + 1) {
            add_change(&found, before, LOST + ALL);
            add_change(&found, time, FOUND + ALL);
        }
        before = time;
        rows++;
        i = line_end(text, i);
    }
    scan->place = i, scan->line = line, scan->time = before, scan->rows = rows;
    return found.count;
}
