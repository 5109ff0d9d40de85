/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Rates, means and times between a source and its sinks.
 */
#ifndef INCISE_TOOLS_SERVE_STREAM_H
#define INCISE_TOOLS_SERVE_STREAM_H

#include "serve.h"

#define SERVE_SINKS 4

struct serve_stream *serve_stream_new(struct serve_source *source, double rate_hz);
void serve_stream_add(struct serve_stream *stream, struct serve_sink *sink);
/* Items of a kind that were sent. */
uint64_t serve_stream_sent(const struct serve_stream *stream, enum serve_kind kind);
uint64_t serve_stream_lost(const struct serve_stream *stream);
void serve_stream_free(struct serve_stream *stream);

#endif
