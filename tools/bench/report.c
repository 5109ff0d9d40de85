// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Fills the places of report.md, a template that is made of blocks with empty lines between:
 *
 *   ## TITLE {section PATH by PROGRAM}  the blocks from here on are of this object of report.json,
 *                      and are left out where it is none; a benchmark's is benchmarks.NAME, and
 *                      measured by a program, or incise-bench
 *   {if KEY} {if !KEY} first line of a block that is left out unless the object has it; all of
 *                      several must hold
 *   {contents}         a block: links to the sections below it
 *   {each LIST where K=V,…} CAPTION  first line of a block for each row of a list of the object,
 *                      or of lists "a,b"; a list item is repeated, and so is the last line of a
 *                      table. Rows of an object are its members.
 *   {to NAME}          a link to a benchmark's section
 *   {VALUE}            of the object or row; {: VALUE} with the text in front, if any
 *
 * VALUE is KEY*FACTOR PART:DIGITS needs N of BENCHMARK.LIST where K=V,…, all but KEY optional. A KEY
 * leads inwards, "a.b", or is a ratio, "a/b"; "@" is the row's name, or that of its list, "." the row
 * itself, "count" how many rows there are. Without digits it is a text, or yes and no. A PART is
 * of several rows: least, largest (of magnitude), range, median, sum, holding (how many are true,
 * or a text: "3 of 12"). In a table with parts rows are one whose other columns are equal. A
 * column without a value is left out, as is a row of a table without {each}; other values that are
 * missing are "–". A percentile needs N samples: without a value it is shown as "–", with the
 * reason below its table.
 */
#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../../lib/base/ascending.h"
#include "../cli/control_character.h"
#include "../cli/document.h"
#include "bench.h"
#include "report.h"

/* Longer tables are for programs: the JSON has them. */
#define ROWS_MAX 500
#define COLUMNS_MAX 16
#define TEXT 400

enum part {
	PART_VALUE,
	PART_LEAST,
	PART_LARGEST,
	PART_RANGE,
	PART_MEDIAN,
	PART_SUM,
	PART_HOLDING,
	PART_COUNT
};
static const char *const parts[] = {"",	      "least", "largest", "range",
				    "median", "sum",   "holding", "count"};

struct value {
	char key[80], by[80], lists[200], where[120];
	enum part part;
	double factor;
	int digits; /* significant ones; 0: text */
	int needs;  /* samples, for a percentile; 0 */
};

struct row {
	const char *name;
	const json_t *object;
};

struct rows {
	struct row *row;
	int *group; /* of each row: its number */
	int n;
	char names[200]; /* of the lists */
};

struct report {
	const json_t *report, *object; /* of the section */
	const char *folder;
	FILE *out;
	bool item;	 /* the last block was a list item */
	char *benchmark; /* of the section; "": none */
};

/* --- Markdown --- */

/* One line, which cannot end the fence that it stands in. */
static void put_command(FILE *out, const char *text)
{
	for (; *text; text++)
		fputc(*text == '`' ? '\'' : control_character(text) ? ' ' : *text, out);
}

/* An empty line in front of a block, but not between list items. */
static void start_block(struct report *r, bool item)
{
	if (!item || !r->item)
		fputc('\n', r->out);
	r->item = item;
}

/* --- values --- */

void report_number(double value, int digits, char *text, size_t size)
{
	static const char *const raised[] = {"⁰", "¹", "²", "³", "⁴",
					     "⁵", "⁶", "⁷", "⁸", "⁹"};
	char plain[64], power[64] = "", *e;

	if (!isfinite(value)) {
		snprintf(text, size, "–");
		return;
	}
	snprintf(plain, sizeof(plain), "%.*e", digits - 1, value);
	/* No rounding hides that a ratio is not 1, to as many digits as a reader can use. */
	while (value != 1 && atof(plain) == 1 && digits < 9)
		snprintf(plain, sizeof(plain), "%.*e", digits++, value);
	e = strchr(plain, 'e');
	if (value == 0 || (atoi(e + 1) >= -4 && atoi(e + 1) < 7)) {
		/* As it is, but for digits that it lacks. */
		int after = digits - 1 - atoi(e + 1);

		snprintf(text, size, "%.*f", value == 0 || after < 0 ? 0 : after, value);
		if (strchr(text, '.')) {
			size_t n = strlen(text);

			while (text[n - 1] == '0')
				text[--n] = 0;
			if (text[n - 1] == '.')
				text[n - 1] = 0;
		}
		return;
	}
	for (const char *c = e + (e[1] == '-' ? 2 : 1); *c; c++)
		if (*c >= '0' && *c <= '9' && (*c != '0' || *power))
			strcat(power, raised[*c - '0']);
	snprintf(text, size, "%.*s×10%s%s", (int)(e - plain), plain,
		 e[1] == '-' ? "⁻" : "", power);
}

/* "a.b" of an object; "." and "" are itself. */
static const json_t *at_path(const json_t *object, const char *path)
{
	char key[100];

	while (object && *path && *path != '.') {
		size_t n = strcspn(path, ".");

		snprintf(key, sizeof(key), "%.*s", (int)n, path);
		object = json_object_get(object, key);
		path += n + (path[n] == '.');
	}
	return object;
}

static double number_at(const json_t *object, const char *path)
{
	const json_t *value = at_path(object, path);

	return json_is_number(value) ? json_number_value(value) : NAN;
}

/* "a/b" is a ratio; b may be a number itself. */
static double number(const struct row *row, const struct value *v)
{
	double value = number_at(row->object, v->key);

	if (isdigit((unsigned char)*v->by))
		value /= atof(v->by);
	else if (*v->by)
		value /= number_at(row->object, v->by);
	return value * v->factor;
}

/* Whether there is something to show. */
static bool has(const struct row *row, const struct value *v)
{
	const json_t *value;

	if (v->part == PART_COUNT || *v->key == '@')
		return true;
	if (v->digits)
		return isfinite(number(row, v));
	value = at_path(row->object, v->key);
	return value && !json_is_null(value) &&
	       !(json_is_string(value) && !json_string_length(value));
}

/* A text, yes or no; a number that stands among texts. */
static void row_text(const struct row *row, const struct value *v, char *text,
		     size_t size)
{
	const json_t *value = at_path(row->object, v->key);

	if (*v->key == '@')
		snprintf(text, size, "%s", row->name);
	else if (v->digits)
		report_number(number(row, v), v->digits, text, size);
	else if (json_is_string(value))
		snprintf(text, size, "%s", json_string_value(value));
	else if (json_is_boolean(value))
		snprintf(text, size, "%s", json_is_true(value) ? "yes" : "no");
	else if (json_is_number(value))
		report_number(json_number_value(value), 6, text, size);
	else
		*text = 0;
}

/* Cut @text at @mark; returns the text behind, or "". */
static char *cut(char *text, const char *mark)
{
	char *at = strstr(text, mark);

	if (!at)
		return "";
	*at = 0;
	return at + strlen(mark);
}

/* "KEY*FACTOR PART:DIGITS needs N of LISTS where CONDITION" */
static struct value value_of(const char *text)
{
	struct value v = {.factor = 1};
	char line[TEXT];
	const char *part, *factor;

	snprintf(line, sizeof(line), "%s", text);
	snprintf(v.where, sizeof(v.where), "%s", cut(line, " where "));
	snprintf(v.lists, sizeof(v.lists), "%s", cut(line, " of "));
	v.needs = atoi(cut(line, " needs "));
	v.digits = atoi(cut(line, ":"));
	part = cut(line, " ");
	while (v.part < PART_COUNT && strcmp(part, parts[v.part]))
		v.part++;
	factor = cut(line, "*");
	if (*factor)
		v.factor = atof(factor);
	snprintf(v.by, sizeof(v.by), "%s", cut(line, "/"));
	snprintf(v.key, sizeof(v.key), "%.79s", line);
	if (!strcmp(v.key, "count"))
		v.part = PART_COUNT;
	else if (v.part == PART_COUNT)
		v.part = PART_VALUE; /* of a link: "to NAME" */
	return v;
}

/* --- rows --- */

/* "KEY=TEXT,KEY=TEXT" */
static bool matches(const struct row *row, const char *where)
{
	char copy[120], is[TEXT], *save = NULL;

	snprintf(copy, sizeof(copy), "%s", where);
	for (char *one = strtok_r(copy, ",", &save); one;
	     one = strtok_r(NULL, ",", &save)) {
		const char *wanted = cut(one, "=");
		struct value v = value_of(one);

		row_text(row, &v, is, sizeof(is));
		if (strcmp(is, wanted))
			return false;
	}
	return true;
}

static void add_row(struct rows *rows, const char *name, const json_t *object,
		    const char *where)
{
	struct row row = {name, object};
	size_t n = (size_t)rows->n + 1;

	if (!matches(&row, where))
		return;
	rows->row = cli_resize(rows->row, n, sizeof(*rows->row));
	rows->group = cli_resize(rows->group, n, sizeof(*rows->group));
	rows->group[rows->n] = 0;
	rows->row[rows->n++] = row;
}

/* Objects of lists, or texts; of an object all members that can be shown. */
static void find_rows(const json_t *object, const char *lists, const char *where,
		      struct rows *rows)
{
	char *save = NULL;

	*rows = (struct rows){0};
	snprintf(rows->names, sizeof(rows->names), "%s", lists);
	for (char *path = strtok_r(rows->names, ",", &save); path;
	     path = strtok_r(NULL, ",", &save)) {
		const json_t *list = at_path(object, path), *member;
		const char *key;
		size_t i;

		json_array_foreach((json_t *)list, i, member)
		{
			if (json_is_object(member) || json_is_string(member))
				add_row(rows, path, member, where);
		}
		json_object_foreach((json_t *)list, key, member)
		{
			if (!json_is_array(member) && !json_is_null(member))
				add_row(rows, key, member, where);
		}
	}
}

static void free_rows(struct rows *rows)
{
	free(rows->row);
	free(rows->group);
}

static bool any_has(const struct rows *rows, const struct value *v)
{
	bool any = false;

	for (int i = 0; i < rows->n; i++)
		any |= v->part == PART_HOLDING || has(&rows->row[i], v);
	return any;
}

static bool same(const struct row *a, const struct row *b, const struct value *columns,
		 int n)
{
	char left[TEXT], right[TEXT];

	for (const struct value *v = columns; v < columns + n; v++) {
		if (v->part != PART_VALUE)
			continue;
		row_text(a, v, left, sizeof(left));
		row_text(b, v, right, sizeof(right));
		if (strcmp(left, right))
			return false;
	}
	return true;
}

/* Number the groups; returns how many. */
static int make_groups(struct rows *rows, const struct value *columns, int n)
{
	bool grouped = false;
	int groups = 0;

	for (int k = 0; k < n; k++)
		grouped |= columns[k].part != PART_VALUE;
	for (int i = 0; i < rows->n; i++) {
		int like = grouped ? 0 : i;

		while (like < i && !same(&rows->row[i], &rows->row[like], columns, n))
			like++;
		rows->group[i] = like < i ? rows->group[like] : groups++;
	}
	return groups;
}

/* One number of those in the rows of a group; NaN of none. */
static double summed_up(const struct rows *rows, int group, const struct value *v,
			enum part part)
{
	double *values = cli_alloc((size_t)rows->n, sizeof(*values)), value = 0;
	int n = 0;

	for (int i = 0; i < rows->n; i++) {
		double one = number(&rows->row[i], v);

		if (rows->group[i] == group && isfinite(one))
			values[n++] = one;
	}
	qsort(values, (size_t)n, sizeof(*values), ascending);
	if (!n)
		value = NAN;
	else if (part == PART_LEAST)
		value = values[0];
	else if (part == PART_LARGEST)
		value = fabs(values[0]) > values[n - 1] ? -values[0] : values[n - 1];
	else if (part == PART_RANGE)
		value = values[n - 1];
	else if (part == PART_MEDIAN)
		value = (values[n / 2] + values[(n - 1) / 2]) / 2;
	else
		for (int i = 0; i < n; i++)
			value += values[i];
	free(values);
	return value;
}

/* A value of a group, in TEXT bytes. */
static void cell_text(const struct rows *rows, int group, const struct value *v,
		      char *text)
{
	int n = 0, asked = 0, holding = 0, first = -1;
	char least[64];

	for (int i = 0; i < rows->n; i++) {
		const json_t *value = at_path(rows->row[i].object, v->key);

		if (rows->group[i] != group)
			continue;
		n++;
		first = first < 0 ? i : first;
		holding += json_is_true(value) || json_is_string(value);
		asked += json_is_boolean(value);
	}
	if (v->part == PART_VALUE)
		row_text(&rows->row[first], v, text, TEXT);
	else if (v->part == PART_COUNT)
		snprintf(text, TEXT, "%d", n);
	else if (v->part == PART_HOLDING)
		/* Where the answer is yes or no, of those that were asked. */
		snprintf(text, TEXT, "%d of %d", holding, asked ? asked : n);
	else
		report_number(summed_up(rows, group, v, v->part), v->digits, text, TEXT);
	if (v->part != PART_RANGE)
		return;
	report_number(summed_up(rows, group, v, PART_LEAST), v->digits, least,
		      sizeof(least));
	if (strcmp(least, text)) {
		memmove(text + strlen(least) + 4, text, strlen(text) + 1);
		memcpy(text, least, strlen(least));
		memcpy(text + strlen(least), " to ", 4);
	}
}

/* --- text with places --- */

/* A link, where the report has the section. */
static void put_link(struct report *r, const char *benchmark)
{
	const struct report_section *s = report_sections();
	char anchor[100];

	while (*s->benchmark && strcmp(s->benchmark, benchmark))
		s++;
	if (!*s->benchmark ||
	    !json_object_get(json_object_get(r->report, "benchmarks"), benchmark)) {
		document_text(r->out, benchmark);
		return;
	}
	document_anchor(s->title, anchor, sizeof(anchor));
	fprintf(r->out, "[%s](#%s)", benchmark, anchor);
}

/* Whether a percentile is missing where others of its samples are not. */
static bool lacks_samples(const struct row *row, const struct value *v)
{
	char parent[sizeof(v->key)];
	char *dot;

	snprintf(parent, sizeof(parent), "%s", v->key);
	dot = strrchr(parent, '.');
	if (dot)
		*dot = 0;
	return v->needs && !has(row, v) &&
	       (!dot || json_is_object(at_path(row->object, parent)));
}

enum placed { PLACED, MISSING, TOO_FEW_SAMPLES };

/* A place's text without its braces. */
static enum placed put_place(struct report *r, const struct row *row, const char *place,
			     void (*put)(FILE *, const char *))
{
	size_t front = *place == ':' ? 2 : 0;
	struct value v = value_of(place + front);
	struct rows rows = {.row = (struct row *)row, .group = (int[]){0}, .n = 1};
	char text[TEXT], path[64] = "benchmarks.";
	enum placed placed = PLACED;

	if (!strcmp(v.key, "to")) {
		put_link(r, place + 3);
		return PLACED;
	}
	if (*v.lists) {
		size_t benchmark = strcspn(v.lists, ".");

		strncat(path, v.lists, benchmark);
		find_rows(at_path(r->report, path), v.lists + benchmark + 1, v.where,
			  &rows);
	}
	if (any_has(&rows, &v) || v.part == PART_COUNT) {
		cell_text(&rows, 0, &v, text);
		fprintf(r->out, "%.*s", (int)front, place);
		put(r->out, text);
	} else if (rows.n && lacks_samples(rows.row, &v)) {
		fprintf(r->out, "– (fewer than %d samples) ", v.needs);
		placed = TOO_FEW_SAMPLES;
	} else {
		fputs(front ? "" : "–", r->out);
		placed = MISSING;
	}
	if (*v.lists)
		free_rows(&rows);
	return placed;
}

/* Returns whether its first place has a value. */
static bool put_line(struct report *r, const struct row *row, const char *line,
		     void (*put)(FILE *, const char *))
{
	const struct row whole = {"", r->object};
	bool first = true, there = true;
	char place[TEXT];

	while (*line) {
		size_t n = strcspn(line, "{");
		enum placed placed;

		fwrite(line, 1, n, r->out);
		line += n;
		if (!*line)
			break;
		n = strcspn(line, "}");
		snprintf(place, sizeof(place), "%.*s", (int)n - 1, line + 1);
		placed = put_place(r, row ? row : &whole, place, put);
		if (placed == MISSING && first)
			there = false;
		first = false;
		line += n + 1;
		/* A reason has no unit. */
		if (placed == TOO_FEW_SAMPLES)
			line += strcspn(line, "|");
	}
	return there;
}

/* --- blocks --- */

/* Lines of the template, or some of them. */
struct block {
	char **line;
	int n;
};

/* The template in lines, cut once. */
static struct block template_lines(void)
{
	static struct block all;
	char *text = all.n ? "" : strdup(text_report_md);

	if (!all.n)
		all.line = cli_alloc(strlen(text_report_md), sizeof(*all.line));
	while (*text) {
		all.line[all.n++] = text;
		text += strcspn(text, "\n");
		*text++ = 0;
	}
	return all;
}

/* Take the next block off the lines, without its empty lines. */
static struct block next_block(struct block *lines)
{
	struct block block;

	for (; lines->n && !**lines->line; lines->n--)
		lines->line++;
	block = (struct block){lines->line, 0};
	for (; lines->n && **lines->line; lines->n--, lines->line++)
		block.n++;
	return block;
}

/* Text behind "{NAME " up to "}" in a block's first line, in @argument, or NULL. */
static char *directive(struct block block, const char *name, char argument[TEXT])
{
	char opening[20], *at;

	snprintf(opening, sizeof(opening), "{%s ", name);
	at = block.n ? strstr(*block.line, opening) : NULL;
	if (!at)
		return NULL;
	snprintf(argument, TEXT, "%.*s", (int)strcspn(at, "}") - (int)strlen(opening),
		 at + strlen(opening));
	return argument;
}

static struct block rest(struct block block)
{
	return (struct block){block.line + 1, block.n - 1};
}

/* Lines of a paragraph or of list items as one each. */
static void put_paragraph(struct report *r, struct block block, const struct row *row)
{
	for (int i = 0; i < block.n; i++) {
		const char *line = block.line[i] + strspn(block.line[i], " ");
		bool item = !strncmp(line, "- ", 2);

		if (i && !item)
			fputc(' ', r->out);
		else
			start_block(r, item);
		put_line(r, row, line, document_text);
		if (i + 1 == block.n || !strncmp(block.line[i + 1], "- ", 2))
			fputc('\n', r->out);
	}
}

static void put_fence(struct report *r, struct block block)
{
	start_block(r, false);
	for (int i = 0; i < block.n; i++) {
		put_line(r, NULL, block.line[i], put_command);
		fputc('\n', r->out);
	}
}

/* "![alt](FILE)" and its caption, where the folder has the file. */
static void put_plot(struct report *r, struct block block)
{
	const char *file = strstr(*block.line, "](") + 2;
	char *path = cli_text("%s/%.*s", r->folder, (int)strcspn(file, ")"), file);

	if (!access(path, R_OK)) {
		put_paragraph(r, (struct block){block.line, 1}, NULL);
		put_paragraph(r, rest(block), NULL);
	}
	free(path);
}

/* --- tables --- */

struct table {
	char *heading[COLUMNS_MAX];
	struct value column[COLUMNS_MAX];
	bool shown[COLUMNS_MAX];
	int n;
};

/* Cells of "| a | b |", which is cut in place; returns how many. */
static int split(char *line, char *cell[COLUMNS_MAX])
{
	int n = 0;

	for (char *c = line, *bar; n < COLUMNS_MAX && (bar = strstr(c, " |"));
	     c = bar + 1) {
		*bar = 0;
		cell[n++] = c + 2; /* behind "| " */
	}
	return n;
}

/* Of a line of headings and one of places, copies of which live as long as the program. */
static struct table table_of(const char *headings, const char *places)
{
	struct table t = {.n = split(strdup(headings), t.heading)};
	char *place[COLUMNS_MAX];

	split(strdup(places), place);
	for (int k = 0; k < t.n; k++) {
		char *value = cut(place[k], "{");

		cut(value, "}");
		t.column[k] = value_of(value);
	}
	return t;
}

/* Caption, headings and alignment. */
static void put_head(struct report *r, const struct table *t, const char *caption)
{
	fprintf(r->out, "\n%s\n\n", caption);
	for (int k = 0; k < t->n; k++)
		if (t->shown[k])
			fprintf(r->out, "| %s ", t->heading[k]);
	fputs("|\n", r->out);
	for (int k = 0; k < t->n; k++)
		if (t->shown[k])
			fputs(t->column[k].digits || t->column[k].part ? "| ---: "
								       : "| --- ",
			      r->out);
	fputs("|\n", r->out);
	r->item = false;
}

/* A table whose rows stand in the template; without any of them a line that says so. */
static void put_facts(struct report *r, struct block block)
{
	struct table t = table_of(block.line[1], block.line[2]);
	bool any = false;

	memset(t.shown, true, sizeof(t.shown));
	for (int i = 2; i < block.n; i++) {
		struct report inner = *r;
		char *row;
		size_t size;

		inner.out = open_memstream(&row, &size);
		if (put_line(&inner, NULL, block.line[i], document_text)) {
			if (!any)
				put_head(r, &t, *block.line);
			any = true;
			fflush(inner.out);
			fprintf(r->out, "%s\n", row);
		}
		fclose(inner.out);
		free(row);
	}
	if (!any)
		fputs("\nNothing of this was measured.\n", r->out);
}

/* In a cell a reason would make a table wide, in which nearly all others are empty. */
static void put_reason(struct report *r, const struct table *t, const struct row *row)
{
	const char *why = json_string_value(json_object_get(row->object, "failed"));
	char line[4 * TEXT] = "", text[TEXT];

	for (int k = 0; why && k < t->n && k < 3; k++) {
		const struct value *v = &t->column[k];

		if (!has(row, v))
			continue;
		row_text(row, v, text, sizeof(text));
		snprintf(line + strlen(line), sizeof(line) - strlen(line), "%s%s%s%s",
			 *line ? "; " : "Failed: ", v->digits ? t->heading[k] : "",
			 v->digits ? ": " : "", text);
	}
	if (!why)
		return;
	snprintf(line + strlen(line), sizeof(line) - strlen(line), ". Why: %s", why);
	start_block(r, false);
	document_text(r->out, line);
	fputc('\n', r->out);
}

/* Why percentiles are missing in rows that did not fail. */
static void put_needs(struct report *r, const struct table *t, const struct rows *rows)
{
	const char *front = "\n“–” means fewer samples than the percentile needs:";

	for (int k = 0; k < t->n; k++) {
		const struct value *v = &t->column[k];
		bool missing = false;

		for (int i = 0; v->needs && i < rows->n; i++)
			missing |= lacks_samples(&rows->row[i], v) &&
				   !json_string_length(json_object_get(
					   rows->row[i].object, "failed"));
		if (!missing)
			continue;
		fprintf(r->out, "%s %s takes %d", front, t->heading[k], v->needs);
		front = ",";
	}
	if (*front == ',')
		fputs(".\n", r->out);
}

/* Rows that are equal in all that is not summed up are one. */
static void put_table(struct report *r, struct block block, const char *caption,
		      struct rows *rows)
{
	struct table t = table_of(block.line[0], block.line[1]);
	int groups = make_groups(rows, t.column, t.n);
	char text[TEXT];

	for (int k = 0; k < t.n; k++)
		t.shown[k] = !strcmp(t.column[k].key, "to") || t.column[k].needs ||
			     any_has(rows, &t.column[k]);
	put_head(r, &t, caption);
	for (int i = 0; i < groups && i < ROWS_MAX; i++) {
		for (int k = 0; k < t.n; k++) {
			if (!t.shown[k])
				continue;
			fputs("| ", r->out);
			cell_text(rows, i, &t.column[k], text);
			if (!strcmp(t.column[k].key, "to"))
				put_link(r, rows->row[i].name);
			else
				document_text(r->out, text);
			fputc(' ', r->out);
		}
		fputs("|\n", r->out);
	}
	put_needs(r, &t, rows);
	/* Those of groups are counted in them. */
	for (int i = 0; i < rows->n && groups == rows->n; i++)
		put_reason(r, &t, &rows->row[i]);
	if (groups > ROWS_MAX)
		fprintf(r->out, "\nThe first %d of %d rows.\n", ROWS_MAX, groups);
}

static void put_each(struct report *r, struct block block, char *lists)
{
	const char *where = cut(lists, " where "),
		   *caption = strchr(*block.line, '}') + 1;
	struct rows rows;

	find_rows(r->object, lists, where, &rows);
	if (rows.n && *caption)
		put_table(r, rest(block), caption + 1, &rows);
	else
		for (int i = 0; i < rows.n; i++)
			put_paragraph(r, rest(block), &rows.row[i]);
	free_rows(&rows);
}

/* --- the template --- */

const struct report_section *report_sections(void)
{
	static struct report_section sections[32];
	struct block lines = template_lines();
	struct report_section *s = sections;
	char path[TEXT];

	while (lines.n && (s > sections || !*s->benchmark)) {
		struct block block = next_block(&lines);

		if (directive(block, "section", path) &&
		    sscanf(path, "benchmarks.%31s by %31s", s->benchmark, s->program) >
			    0) {
			if (!*s->program)
				strcpy(s->program, "incise-bench");
			snprintf(s->title, sizeof(s->title), "%.*s",
				 (int)(strstr(*block.line, " {") - *block.line) - 3,
				 *block.line + 3);
			s++;
		} else if (s > sections && block.n && !strncmp(*block.line, "![", 2)) {
			s[-1].plots = true;
		}
	}
	return sections;
}

/* "KEY", or "!KEY": whether there is none. */
static bool holds(const json_t *object, const char *key)
{
	bool negated = *key == '!';
	const json_t *value = at_path(object, key + negated);

	return (json_is_true(value) || json_string_length(value) ||
		json_array_size(value) || json_object_size(value)) != negated;
}

/* Whether all conditions of a line "{if KEY} {if !KEY}" hold. */
static bool all_hold(const json_t *object, const char *line)
{
	char key[TEXT];

	for (; (line = strstr(line, "{if ")); line++) {
		snprintf(key, sizeof(key), "%.*s", (int)strcspn(line + 4, "}"), line + 4);
		if (!holds(object, key))
			return false;
	}
	return true;
}

static void put_block(struct report *r, struct block block)
{
	char argument[TEXT];

	if (directive(block, "if", argument)) {
		if (!all_hold(r->object, *block.line))
			return;
		block = rest(block);
	}
	if (directive(block, "each", argument))
		put_each(r, block, argument);
	else if (!strncmp(*block.line, "```", 3))
		put_fence(r, block);
	else if (!strncmp(*block.line, "![", 2))
		put_plot(r, block);
	else if (block.n > 1 && *block.line[1] == '|')
		put_facts(r, block);
	else
		put_paragraph(r, block, NULL);
}

/* A benchmark's section ends with its data. */
static void end_section(struct report *r)
{
	if (*r->benchmark && json_is_object(r->object))
		fprintf(r->out, "\nAll values as JSON: [data/%s.json](data/%s.json)\n",
			r->benchmark, r->benchmark);
}

/* "loop" of "benchmarks.loop"; "" of another object. */
static char *section_benchmark(char *path)
{
	static const char prefix[] = "benchmarks.";

	return path +
	       (strncmp(path, prefix, strlen(prefix)) ? strlen(path) : strlen(prefix));
}

static void start_section(struct report *r, const char *title, char *path)
{
	end_section(r);
	cut(path, " by ");
	r->object = at_path(r->report, path);
	r->benchmark = section_benchmark(path);
	if (json_is_object(r->object))
		fprintf(r->out, "\n%.*s\n", (int)(strstr(title, " {") - title), title);
	r->item = false;
}

static void put_contents(FILE *out, const char *body)
{
	for (const char *line = body; line; line = strchr(line, '\n')) {
		char title[200], anchor[200];

		line += *line == '\n';
		if (strncmp(line, "## ", 3))
			continue;
		snprintf(title, sizeof(title), "%.*s", (int)strcspn(line + 3, "\n"),
			 line + 3);
		document_anchor(title, anchor, sizeof(anchor));
		fprintf(out, "- [%s](#%s)\n", title, anchor);
	}
}

void report_markdown(const json_t *report, const char *folder, FILE *out)
{
	struct report r = {.report = report,
			   .object = report,
			   .folder = folder,
			   .out = out,
			   .benchmark = ""};
	struct block lines = template_lines(), block = next_block(&lines);
	char *body = NULL, path[TEXT], section[TEXT];
	size_t size;

	/* Its first block is about the template, but for the title, its last line. */
	fprintf(out, "%s\n", block.line[block.n - 1]);
	while (lines.n) {
		block = next_block(&lines);
		if (block.n && !strcmp(*block.line, "{contents}")) {
			r.out = open_memstream(&body, &size);
			if (!r.out)
				cli_fail("no memory");
		} else if (directive(block, "section", path)) {
			start_section(&r, *block.line, path);
			memcpy(section, path, sizeof(section));
			r.benchmark = section_benchmark(section);
		} else if (block.n && json_is_object(r.object)) {
			put_block(&r, block);
		}
	}
	end_section(&r);
	fclose(r.out);
	fputc('\n', out);
	put_contents(out, body);
	fwrite(body, 1, size, out);
	free(body);
}
