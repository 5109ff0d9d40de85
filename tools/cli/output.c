// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Inputs and outputs of a command, compared by device and inode: an output is never an input,
 * nor inside a recording that is read, and replaces a file only with --overwrite. See cli.h.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "cli.h"

struct place {
	const char *path; /* as given, for messages */
	struct stat st;
};

struct output {
	struct place file, folder; /* of "-" there is no folder */
	const char *name;	   /* below its folder */
	bool exists;
	struct output *next;
};

struct input {
	struct place at;
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
	if (output->folder.path && S_ISDIR(input->at.st.st_mode) &&
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
	char *beside = cli_text("%s.sd", path),
	     *within = cli_text("%s/recording.db", path);
	struct stat st;

	/* A folder is an input as a recording only: others are just words, or made of files. */
	if (!strcmp(path, "-")) {
		if (!fstat(STDIN_FILENO, &st) && S_ISREG(st.st_mode))
			note_input("standard input", &st);
	} else if (!stat(path, &st) && (S_ISREG(st.st_mode) || !access(within, F_OK))) {
		note_input(path, &st);
		/* The uncertainty of a model belongs to it. */
		if (S_ISREG(st.st_mode) && !stat(beside, &st) && S_ISREG(st.st_mode))
			note_input(beside, &st);
	}
	free(beside);
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
static void note_output(const char *path, bool once)
{
	struct output output, *kept;

	for (const struct output *o = outputs; o; o = o->next)
		if (!strcmp(o->file.path, path) && !once)
			return;
	if (!find_output(path, &output))
		return;
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
	kept->next = outputs;
	outputs = kept;
}

void cli_output(const char *path)
{
	note_output(path, false);
}

void cli_output_once(const char *path)
{
	note_output(path, true);
}
