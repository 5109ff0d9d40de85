// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The statement of a recording, a text that comes with a signature. An accepted one is written
 * again as the same bytes.
 */
#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/record/statement.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct incise_seal_statement statement;
	char text[INCISE_STATEMENT_MAX];
	struct incise_error err = {0};
	int rc = incise_seal_read(&statement, (const char *)data, size, &err);

	if (rc ? rc != -EINVAL || !err.code
	       : incise_statement_write(&statement, text) != size ||
			    memcmp(text, data, size) != 0)
		abort();
	return 0;
}
