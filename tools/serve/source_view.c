// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A file in the viewer of a page alone: nothing is sent.
 */
#include <stdlib.h>
#include "../cli/cli.h"
#include "serve.h"

#define STILL_NS 100000000LL

static int view_read(struct serve_source *source, struct serve_stream *stream,
		     int64_t now_ns, int64_t *next_ns)
{
	(void)source;
	(void)stream;
	*next_ns = now_ns + STILL_NS;
	return 0;
}

static int64_t view_utc(struct serve_source *source, int64_t t_ns)
{
	(void)source;
	return serve_utc_of(t_ns);
}

static void view_free(struct serve_source *source)
{
	free(source);
}

static const struct serve_source_ops view_ops = {
	.read = view_read, .utc = view_utc, .free = view_free};

struct serve_source *serve_view_open(const struct serve_source_options *options,
				     struct serve_info *info)
{
	struct serve_source *source = cli_alloc(1, sizeof(*source));

	source->ops = &view_ops;
	info->name = cli_text("viewer of %s", options->operand);
	return source;
}
