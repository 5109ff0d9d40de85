// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Parts that all profiles of messages use; see messages.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <incise/clock.h>
#include "decimal.h"
#include "messages.h"

int incise_messages_reserve(struct incise_messages *messages, size_t bytes)
{
	/* Each byte may be quoted. */
	size_t capacity =
		(16 + 4 * INCISE_BUDGET_COLUMNS) * INCISE_DECIMAL_MAX + 2 * bytes;
	char *text;

	if (capacity <= messages->capacity)
		return 0;
	text = realloc(messages->text, capacity);
	if (!text)
		return -ENOMEM;
	messages->text = text;
	messages->capacity = capacity;
	return 0;
}

uint64_t incise_message_ns(const struct incise_messages *messages, int64_t t_ns)
{
	int64_t ns = t_ns + messages->wall_ns;

	if (messages->wall && !incise_wall_tai(messages->wall, t_ns, &ns, NULL))
		ns -= incise_wall_utc_offset_s(messages->wall, t_ns) * INCISE_NS_PER_S;
	return ns > 0 ? (uint64_t)ns : 0;
}

int incise_messages_pairs(struct incise_messages *messages, const char *name,
			  struct incise_provenance *pairs)
{
	int rc = pairs->rc;

	if (!rc)
		incise_mcap_metadata(&messages->mcap, name, pairs);
	incise_provenance_free(pairs);
	return rc;
}
