// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The text of a statement; see statement.h. It comes from outside.
 */
#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include "seal_chain.h"
#include "statement.h"

#define TITLE "incise statement 1\n"

const char *const incise_seal_parts[INCISE_SEAL_PARTS] = {
	"start",   "configuration", "calibration", "force",  "tracker",
	"camera",  "wall",	    "depth",	   "events", "knots",
	"streams", "meta",	    "camera.mkv",
};

bool incise_statement_hex(const char *text, size_t n)
{
	return strlen(text) == n && strspn(text, "0123456789abcdef") == n;
}

int64_t incise_statement_earlier(int i, int n, int64_t last)
{
	return n < INCISE_STATEMENT_EARLIER ? i : last / n * i + last % n * i / n;
}

/* --- writing -------------------------------------------------------------------------- */

struct out {
	char *text;
	size_t n;
	bool full;
};

INCISE_PRINTF(2, 3) static void print(struct out *out, const char *fmt, ...)
{
	va_list args;
	int n;

	va_start(args, fmt);
	n = vsnprintf(out->text + out->n, INCISE_STATEMENT_MAX - out->n, fmt, args);
	va_end(args);
	out->full |= n < 0 || (size_t)n >= INCISE_STATEMENT_MAX - out->n;
	if (!out->full)
		out->n += n;
}

static void print_head(struct out *out, const char *what,
		       const struct incise_seal_head *head)
{
	print(out, "%s %" PRId64 " %" PRId64 " %s\n", what, head->commit, head->t_ns,
	      head->head);
}

size_t incise_statement_write(const struct incise_seal_statement *statement,
			      char text[INCISE_STATEMENT_MAX])
{
	struct out out = {.text = text};

	print(&out, TITLE);
	print(&out, "identity %s\n", statement->identity);
	print(&out, "name %s\n", statement->name);
	print(&out, "software %s\n", statement->software);
	print(&out, "host %s\n", statement->host);
	print(&out, "started %s\n", statement->started);
	print(&out, "complete %s\n", statement->complete ? "yes" : "no");
	print_head(&out, "commit", &statement->last);
	for (int i = 0; i < INCISE_STATEMENT_PARTS; i++)
		print(&out, "part %s %" PRIu64 " %s\n", statement->parts[i].name,
		      statement->parts[i].rows, statement->parts[i].digest);
	for (int i = 0; i < statement->n_earlier; i++)
		print_head(&out, "earlier", &statement->earlier[i]);
	print(&out, "end\n");
	return out.full ? 0 : out.n;
}

/* --- reading -------------------------------------------------------------------------- */

struct in {
	const char *at, *end;
	int line;
};

/* The rest of the line behind a word and a space, to a text. */
static bool take_line(struct in *in, const char *word, char *to, size_t size)
{
	const size_t skip = strlen(word) + 1;
	const char *end = memchr(in->at, '\n', in->end - in->at);
	size_t n = end ? end - in->at : 0;

	in->line++;
	if (n < skip || memcmp(in->at, word, skip - 1) != 0 || in->at[skip - 1] != ' ' ||
	    n - skip >= size)
		return false;
	n -= skip;
	memcpy(to, in->at + skip, n);
	to[n] = 0;
	in->at = end + 1;
	for (size_t i = 0; i < n; i++)
		if ((unsigned char)to[i] < ' ' || to[i] == 0x7f)
			return false;
	return true;
}

/* "NUMBER NUMBER DIGEST" */
static bool take_head(struct in *in, const char *word, struct incise_seal_head *head)
{
	char text[120];
	int n = 0;

	return take_line(in, word, text, sizeof(text)) &&
	       sscanf(text, "%" SCNd64 " %" SCNd64 " %64[0-9a-f]%n", &head->commit,
		      &head->t_ns, head->head, &n) == 3 &&
	       n == (int)strlen(text) && head->commit >= 0 &&
	       incise_statement_hex(head->head, 64);
}

static bool take_part(struct in *in, struct incise_seal_part *part, const char *name)
{
	char text[120];
	int n = 0;

	return take_line(in, "part", text, sizeof(text)) &&
	       sscanf(text, "%15s %" SCNu64 " %64[0-9a-f]%n", part->name, &part->rows,
		      part->digest, &n) == 3 &&
	       n == (int)strlen(text) && !strcmp(part->name, name) &&
	       incise_statement_hex(part->digest, 64);
}

static bool take_all(struct in *in, struct incise_seal_statement *s)
{
	char complete[8];

	in->line = 1;
	if (in->end - in->at < (ptrdiff_t)strlen(TITLE) ||
	    memcmp(in->at, TITLE, strlen(TITLE)) != 0)
		return false;
	in->at += strlen(TITLE);
	if (!take_line(in, "identity", s->identity, sizeof(s->identity)) ||
	    !incise_statement_hex(s->identity, 32) ||
	    !take_line(in, "name", s->name, sizeof(s->name)) ||
	    !take_line(in, "software", s->software, sizeof(s->software)) ||
	    !take_line(in, "host", s->host, sizeof(s->host)) ||
	    !take_line(in, "started", s->started, sizeof(s->started)) ||
	    !take_line(in, "complete", complete, sizeof(complete)) ||
	    !take_head(in, "commit", &s->last))
		return false;
	s->complete = !strcmp(complete, "yes");
	for (int i = 0; i < INCISE_STATEMENT_PARTS; i++)
		if (!take_part(in, &s->parts[i], incise_seal_parts[i]))
			return false;
	s->n_earlier = s->last.commit < INCISE_STATEMENT_EARLIER
			       ? (int)s->last.commit
			       : INCISE_STATEMENT_EARLIER;
	for (int i = 0; i < s->n_earlier; i++)
		if (!take_head(in, "earlier", &s->earlier[i]) ||
		    s->earlier[i].commit !=
			    incise_statement_earlier(i, s->n_earlier, s->last.commit))
			return false;
	in->line++;
	return in->end - in->at == 4 && !memcmp(in->at, "end\n", 4);
}

int incise_seal_read(struct incise_seal_statement *statement, const char *text,
		     size_t length, struct incise_error *err)
{
	struct in in = {.at = text, .end = text + length};
	char again[INCISE_STATEMENT_MAX];

	*statement = (struct incise_seal_statement){0};
	/* A number in another form, such as 007, is found as the text is written again. */
	if (length < sizeof(again) && take_all(&in, statement) &&
	    incise_statement_write(statement, again) == length &&
	    !memcmp(again, text, length))
		return 0;
	return incise_error_set(err, EINVAL,
				"not a statement of a recording by incise, or altered: "
				"line %d",
				in.line);
}
