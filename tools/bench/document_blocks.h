/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a document is made of, for those who write it; see document.h.
 */
#ifndef INCISE_DOCUMENT_BLOCKS_H
#define INCISE_DOCUMENT_BLOCKS_H

#include "document.h"

enum block_kind {
	BLOCK_SECTION,
	BLOCK_HEADING,
	BLOCK_TEXT,
	BLOCK_NOTICE,
	BLOCK_ITEM,
	BLOCK_COMMAND,
	BLOCK_FILE,
	BLOCK_PICTURE,
	BLOCK_TABLE,
};

struct cell {
	char *text;
	char *section; /* that it leads to, or NULL */
	bool number;   /* of a column */
};

struct block {
	enum block_kind kind;
	char *text; /* title, caption */
	char *file;
	char *instead;
	struct cell *columns, *cells;
	int n_columns, n_cells;
};

struct document {
	char *title;
	struct block *blocks;
	int n;
};

/*
 * What links to a section end in, the way GitHub makes it from a title: "What it costs" is
 * "what-it-costs". Ends the text at size.
 */
void document_anchor(const char *title, char *anchor, size_t size);

/* How many bytes of UTF-8 a control character here has, of ASCII or of Latin-1; 0: none is. */
int document_control(const char *text);

#endif
