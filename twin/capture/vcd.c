/* The body of a value change dump (vcd.py), word by word. */
#pragma once
#include "../native/core.h"
#include "../native/records.h"
#include "bytes.h"

enum { PART_OF_CHANGES, PART_OF_LEVELS, PART_OFF }; /* SCAN.part; levels: $dumpvars and its like; off: all are x */
enum { NO_LEVEL = -1, NO_CHANGE = -2, OTHER_VALUE = -3 }; /* x and z; no change at all; a number or a text */

INLINE int64_t word_end(BYTES text, int64_t i) {
    while (byte_at(text, i) > ' ')
        i++;
    return i;
}

/* The place after the $end of a comment, and the line there; -1 and the line here without one. */
static int64_t comment_end(BYTES text, int64_t i, int64_t *line) {
    for (int64_t lines = *line; i < text.size; lines += byte_at(text, i++) == '\n')
        if (begins(text, i, "$end")) {
            *line = lines;
            return i + 4;
        }
    return -1;
}

/* The place of the code after a value, and its level, or NO_LEVEL and its like. */
INLINE int64_t level_at(BYTES text, int64_t i, int *level) {
    int c = byte_at(text, i++);
    if (c == '0' || c == '1') {
        *level = c - '0';
        return i;
    }
    int small = c | 32;
    if (small == 'b' || small == 'r' || small == 's') { /* a vector, a real number, a text; then blanks */
        *level = small == 'b' ? 0 : OTHER_VALUE;
        for (; (c = byte_at(text, i)) > ' '; i++)
            if (small == 'b' && c == '1')
                *level = 1;
            else if (c != '0' && *level == 0)
                *level = NO_LEVEL;
        while (i < text.size && (c = byte_at(text, i)) <= ' ' && c != '\n')
            i++;
        return i;
    }
    *level = small == 'x' || small == 'z' || small == 'u' || small == 'w' || c == '-' ? NO_LEVEL : NO_CHANGE;
    return i;
}

/* The place after the code of a signal, and the number of it (`_key`). */
INLINE int64_t code_at(BYTES text, int64_t i, int64_t *key) {
    int c;
    for (*key = 0; (c = byte_at(text, i)) > ' '; i++)
        *key = (*key * 257 + c) % ((int64_t)1 << 53);
    return i;
}

/* Write the changes of wanted signals from scan->place on; return their number. scan then says where and why it ended.

   keys [signals]; levels, first [signals]: present and first level (-1: none yet); lost [signals + 1]: 1 while it is x
   or z, the last one in $dumpoff; times, which [n]: output. */
API int64_t scan_dump(A1(const uint8_t, data), A1(const int64_t, keys, signals), R(SCAN, scan),
                      A1(int8_t, levels, signals), A1(int8_t, first, signals), A1(int8_t, lost, signals + 1),
                      A1(int64_t, times, n), A1(uint8_t, which, n)) {
    BYTES text = {data, data_n};
    CHANGES found = {times, which, times_n, 0};
    int64_t i = scan->place, line = scan->line, time = scan->time, begin = scan->begin, part = scan->part;
    CHECK(i >= 0);
    while (i < data_n && found.count + 2 <= found.room) { /* a signal may be found and change at once */
        int c = byte_at(text, i), problem = 0;
        int64_t start = i;
        if (c <= ' ') {
            line += c == '\n';
            i++;
        } else if (c == '#') {
            int64_t value = 0;
            for (i++; is_digit(c = byte_at(text, i)) && i - start < 19; i++)
                value = 10 * value + (c - '0');
            if (i == start + 1 || c > ' ')
                problem = NO_TIME;
            else if (value < time)
                problem = EARLIER;
            time = value;
            if (begin < 0)
                begin = value;
        } else if (c == '$') { /* a comment goes on to its $end; others are ignored */
            i = word_end(text, i);
            if (i - start == 4) /* $end */
                part = PART_OF_CHANGES;
            else if (i - start > 6 && begins(text, start, "$dump")) {
                int off = begins(text, start, "$dumpof");
                part = off ? PART_OFF : PART_OF_LEVELS;
                if (lost[keys_n] != off)
                    add_change(&found, time, ALL + (off ? LOST : FOUND));
                lost[keys_n] = (int8_t)off;
            } else if (i - start == 8 && begins(text, start, "$co")) {
                i = comment_end(text, i, &line);
                problem = i < 0 ? NO_END : 0;
            }
        } else {
            int level;
            int64_t key, named = level_at(text, i, &level), k = 0;
            i = code_at(text, named, &key);
            if (level == NO_CHANGE || i == named)
                problem = level == NO_CHANGE ? NO_VALUE : NO_SIGNAL;
            else if (level >= NO_LEVEL) {
                while (k < keys_n && keys[k] != key)
                    k++;
                if (k < keys_n) {
                    int known = levels[k] >= 0, late = begin >= 0 && begin < time, changed;
                    if (level == NO_LEVEL) {
                        if (known && !lost[k] && part != PART_OFF)
                            add_change(&found, time, LOST + k);
                        lost[k] |= part != PART_OFF;
                        continue;
                    }
                    if (lost[k] && (known || late))
                        add_change(&found, time, FOUND + k);
                    if (known)
                        changed = levels[k] != level;
                    else {
                        changed = late && !lost[k] && part == PART_OF_CHANGES;
                        first[k] = (int8_t)(changed ? 1 - level : level);
                    }
                    if (changed)
                        add_change(&found, time, k);
                    levels[k] = (int8_t)level;
                    lost[k] = 0;
                }
            }
        }
        if (problem) {
            scan->place = start, scan->line = line, scan->problem = problem;
            return found.count;
        }
    }
    scan->place = i, scan->line = line, scan->time = time, scan->begin = begin, scan->part = part;
    return found.count;
}
