// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Inputs and outputs of a command, compared by device and inode: an output is never an input,
 * nor inside a recording that is read, and replaces a file only with --overwrite. Its extension
 * is one that the command writes, and the files written are listed at the end. See cli.h.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "cli.h"
#include "file_kind.h"

struct output_place {
	const char *path; /* as given, for messages */
	struct stat st;
};

struct output {
	struct output_place file, folder; /* of "-" there is no folder */
	const char *name;		  /* below its folder */
	bool exists;
	bool part;   /* of another output */
	bool within; /* added to a recording that is read */
	struct output *next;
};

struct input {
	struct output_place at;
	struct input *next;
};

static struct input *inputs;
static struct output *outputs;
static bool overwrite;

void cli_allow_overwrite(void)
{
	overwrite = true;
}

bool cli_overwrite(void)
{
	return overwrite;
}

static bool same(const struct stat *a, const struct stat *b)
{
	return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

/* Whether @folder, with its "..", lies in the folder @above, or is it. */
static bool lies_in(const char *folder, const struct stat *above)
{
	char *real = realpath(folder, NULL), *slash;
	struct stat st;
	bool in = false;

	while (real && !in) {
		in = !stat(*real ? real : "/", &st) && same(&st, above);
		slash = strrchr(real, '/');
		if (!slash)
			break;
		*slash = 0;
	}
	free(real);
	return in;
}

static void keep_apart(const struct input *input, const struct output *output)
{
	const char *path = output->file.path;
	const char *called = strcmp(path, "-") ? path : "standard output";

	if (output->exists && same(&input->at.st, &output->file.st))
		cli_fail("%s: is an input (%s); give another path to write", called,
			 input->at.path);
	if (output->folder.path && !output->within && S_ISDIR(input->at.st.st_mode) &&
	    lies_in(output->folder.path, &input->at.st))
		cli_fail("%s: is inside an input (%s); give another path to write",
			 called, input->at.path);
}

static void note_input(const char *path, const struct stat *st)
{
	struct input *input = cli_alloc(1, sizeof(*input));

	*input = (struct input){.at = {cli_text("%s", path), *st}, .next = inputs};
	inputs = input;
	for (const struct output *output = outputs; output; output = output->next)
		keep_apart(input, output);
}

void cli_input(const char *path)
{
	char *beside[] = {cli_text("%s.sd", path), cli_text("%s.tex", path)},
	     *whole = file_without_choice(path),
	     *within = cli_text("%s/recording.db", whole);
	struct stat st;

	/* A folder is an input as a recording only: others are just words, or made of files. */
	if (!strcmp(path, "-")) {
		if (!fstat(STDIN_FILENO, &st) && S_ISREG(st.st_mode))
			note_input("standard input", &st);
	} else if (!stat(whole, &st) && (S_ISREG(st.st_mode) || !access(within, F_OK))) {
		note_input(whole, &st);
		/* The uncertainty and the texture of a model belong to it. */
		for (int i = 0; i < 2 && S_ISREG(st.st_mode); i++) {
			struct stat other;

			if (!stat(beside[i], &other) && S_ISREG(other.st_mode))
				note_input(beside[i], &other);
		}
	}
	free(beside[0]);
	free(beside[1]);
	free(whole);
	free(within);
}

static bool same_output(const struct output *a, const struct output *b)
{
	if (a->exists && b->exists)
		return same(&a->file.st, &b->file.st);
	return a->folder.path && b->folder.path && a->exists == b->exists &&
	       same(&a->folder.st, &b->folder.st) && !strcmp(a->name, b->name);
}

/* The nearest folder above @path that exists, as missing ones may be made: free(3). */
static char *folder_of(const char *path, struct stat *st)
{
	char *folder = cli_text("%s", path), *slash;

	while ((slash = strrchr(folder, '/'))) {
		slash[slash == folder] = 0;
		if (!stat(folder, st) || slash == folder)
			break;
	}
	return folder;
}

/* Where it is, through links, or would be; false: a device or a pipe, which takes anything. */
static bool find_output(const char *path, struct output *output)
{
	char *real, *whole;

	*output = (struct output){.file.path = path};
	if (!strcmp(path, "-")) {
		output->exists = !fstat(STDOUT_FILENO, &output->file.st);
		return output->exists && S_ISREG(output->file.st.st_mode);
	}
	output->exists = !stat(path, &output->file.st);
	if (output->exists && !S_ISREG(output->file.st.st_mode) &&
	    !S_ISDIR(output->file.st.st_mode))
		return false;
	real = realpath(path, NULL);
	whole = real ? cli_text("%s", real)
		     : cli_text("%s%s", *path == '/' ? "" : "./", path);
	output->folder.path = folder_of(whole, &output->folder.st);
	output->name = cli_text("%s", whole + strlen(output->folder.path));
	free(whole);
	free(real);
	return true;
}

/* @once: no other option may name it. */
static void note_output(const char *path, bool once, bool part, bool within)
{
	struct output output, *kept;

	for (const struct output *o = outputs; o; o = o->next)
		if (!strcmp(o->file.path, path) && !once)
			return;
	if (!find_output(path, &output))
		return;
	output.within = within;
	for (const struct input *input = inputs; input; input = input->next)
		keep_apart(input, &output);
	for (const struct output *o = outputs; o; o = o->next)
		if (same_output(o, &output))
			cli_fail("%s: would be written twice; give each output its own "
				 "path",
				 path);
	if (output.exists && S_ISREG(output.file.st.st_mode) && strcmp(path, "-") &&
	    !overwrite)
		cli_fail("%s: exists; give --overwrite to replace it, or another path",
			 path);
	kept = cli_alloc(1, sizeof(*kept));
	*kept = output;
	kept->file.path = cli_text("%s", path);
	kept->part = part;
	kept->next = outputs;
	outputs = kept;
}

void cli_output(const char *path)
{
	note_output(path, false, false, false);
}

void cli_output_part(const char *path)
{
	note_output(path, false, true, false);
}

void cli_output_once(const char *path)
{
	note_output(path, true, false, false);
}

void cli_output_within(const char *path)
{
	note_output(path, false, false, true);
}

/* --- extensions ------------------------------------------------------------------------- */

/* ".png .svg .pdf" as ".png, .svg or .pdf": free(3) */
static char *alternatives(const char *list)
{
	char *text = cli_text("%s", ""), *longer;

	for (list += strspn(list, " "); *list;) {
		int n = (int)strcspn(list, " ");
		bool last = !list[n], first = !*text;

		longer = cli_text("%s%s%.*s", text,
				  first	 ? ""
				  : last ? " or "
					 : ", ",
				  n, list);
		free(text);
		text = longer;
		list += n + strspn(list + n, " ");
	}
	return text;
}

/* The extension of a path with its dot; NULL: a name without one. */
static const char *extension_of(const char *path)
{
	const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
	const char *dot = strrchr(name, '.');

	return dot == name ? NULL : dot;
}

/* Length of the longest extension of the list that ends the path; 0: none does. */
static size_t match_extension(const char *path, const char *list)
{
	size_t longest = 0;

	for (size_t n; extension_of(path) && *(list += strspn(list, " ")); list += n) {
		char *extension;

		n = strcspn(list, " ");
		extension = cli_text("%.*s", (int)n, list);
		if (n > longest && cli_ends_with(path, extension))
			longest = n;
		free(extension);
	}
	return longest;
}

bool cli_extension_in(const char *path, const char *list)
{
	return match_extension(path, list);
}

void cli_extension(const char *option, const char *path, const char *list)
{
	struct stat st;

	if (!strcmp(path, "-") || !extension_of(path) || cli_extension_in(path, list) ||
	    (!stat(path, &st) && !S_ISREG(st.st_mode)))
		return;
	cli_usage("--%s: %s: unknown extension %s; give %s", option, path,
		  extension_of(path), alternatives(list));
}

/* --- several files of one option -------------------------------------------------------- */

static bool is_row_of(const struct cli_option *row, const struct cli_option *first)
{
	return row->name && !strcmp(row->name, first->name);
}

/* The row whose extension ends this path; NULL: none. */
static const struct cli_option *find_output_row(const struct cli_option *first,
						const char *path)
{
	const struct cli_option *found = NULL;
	size_t longest = 0;

	for (const struct cli_option *row = first; is_row_of(row, first); row++) {
		size_t n = row->extensions ? match_extension(path, row->extensions) : 0;

		if (n > longest) {
			longest = n;
			found = row;
		}
	}
	return found;
}

char *cli_output_extensions(const struct cli_option *first)
{
	char *list = cli_text("%s", first->extensions ? first->extensions : ""), *before;

	for (const struct cli_option *row = first + 1; is_row_of(row, first); row++)
		if (row->extensions) {
			before = list;
			list = cli_text("%s%s%s", before, *before ? " " : "",
					row->extensions);
			free(before);
		}
	return list;
}

const struct cli_option *cli_output_row(const struct cli_option *first, char **path)
{
	size_t form = strcspn(*path, ":/");
	char *named = cli_text("x.%.*s", (int)form, *path);
	const struct cli_option *row = first, *found = find_output_row(first, named);
	struct stat st;
	bool there = !stat(*path, &st), folder = there && S_ISDIR(st.st_mode);

	free(named);
	if ((*path)[form] == ':' && found) {
		*path += form + 1;
		return found;
	}
	if (!strcmp(*path, "-") || (there && !S_ISREG(st.st_mode) && !folder)) {
		while (row->kind != CLI_KIND_OUTPUT && is_row_of(row + 1, first))
			row++;
		return row;
	}
	found = find_output_row(first, *path);
	if (found)
		return found;
	/* An extension that none has is refused later: that the file is an input counts more. */
	for (row = first; is_row_of(row, first); row++)
		if (!row->extensions == !(extension_of(*path) && !folder))
			return row;
	return first;
}

/* --- files written ---------------------------------------------------------------------- */

/* More of them in a folder of their own are named by that folder. */
#define FEW 3

static bool is_written(const struct output *output)
{
	const struct stat *before = &output->file.st;
	struct stat now;

	if (output->part || !strcmp(output->file.path, "-") ||
	    stat(output->file.path, &now))
		return false;
	return !output->exists || !same(&now, before) || now.st_size != before->st_size ||
	       now.st_mtim.tv_sec != before->st_mtim.tv_sec ||
	       now.st_mtim.tv_nsec != before->st_mtim.tv_nsec;
}

/* Length of the folder in a path with its slash; 0: none. */
static size_t folder_length(const char *path)
{
	const char *slash = strrchr(path, '/');

	return slash ? (size_t)(slash + 1 - path) : 0;
}

static bool share_folder(const char *a, const char *b)
{
	size_t n = folder_length(a);

	return n && n == folder_length(b) && !strncmp(a, b, n);
}

struct written {
	const char *path;
	int files; /* 0: this one; else as many, of its folder */
};

/* Name a crowded folder once; returns how many names remain. */
static int name_folders(struct written *list, int n)
{
	for (int i = 0; i < n; i++) {
		int kept = i + 1, alike = 1;

		for (int k = i + 1; k < n; k++)
			alike += share_folder(list[i].path, list[k].path);
		if (alike <= FEW)
			continue;
		for (int k = i + 1; k < n; k++)
			if (!share_folder(list[i].path, list[k].path))
				list[kept++] = list[k];
		list[i].files = alike;
		n = kept;
	}
	return n;
}

void cli_written(void)
{
	int n = 0, end;
	struct written *list;

	for (const struct output *o = outputs; o; o = o->next)
		n += is_written(o);
	list = cli_alloc((size_t)n, sizeof(*list));
	end = n;
	/* The last one noted comes first. */
	for (const struct output *o = outputs; o && end; o = o->next)
		if (is_written(o))
			list[--end].path = strncmp(o->file.path, "./", 2)
						   ? o->file.path
						   : o->file.path + 2;
	n = name_folders(list, n);
	for (int i = 0; i < n; i++) {
		printf("%s", i == 0 ? "wrote " : i == n - 1 ? " and " : ", ");
		if (list[i].files)
			printf("%.*s (%d files)", (int)folder_length(list[i].path),
			       list[i].path, list[i].files);
		else
			printf("%s", list[i].path);
	}
	if (n)
		putchar('\n');
	free(list);
}
