/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The streams of a recording for people and programs: losses and times.
 */
#ifndef INCISE_STREAM_REPORT_H
#define INCISE_STREAM_REPORT_H

#include <stddef.h>
#include <jansson.h>
#include <incise/recording.h>
#include <incise/tracker.h>

/* The heading of lines, and a line of one stream, both without a newline. */
extern const char stream_heading[];
int stream_line(const struct incise_stream *stream, char *text, size_t size);

/* On standard output; nothing where there are none. */
void stream_table(const struct incise_stream *streams, int n);

/* An array of objects; NULL: no memory. */
json_t *stream_json(const struct incise_stream *streams, int n);

/* Poses taken and unusable, and counts by flag. */
json_t *pose_json(const struct incise_pose_counts *poses);

#endif
