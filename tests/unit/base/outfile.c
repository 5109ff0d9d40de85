// SPDX-License-Identifier: GPL-2.0-or-later
/* Files that appear whole or not at all. */
#include "../unit.h"
#include <dirent.h>
#include <grp.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <signal.h>
#include <incise/outfile.h>

static char folder[] = "/tmp/incise-outfile-XXXXXX";
static char path[64];

static int set_up(void **state)
{
	strcpy(strrchr(folder, '-') + 1, "XXXXXX");
	if (!mkdtemp(folder))
		return -1;
	snprintf(path, sizeof(path), "%s/file", folder);
	return 0;
}

/* Names in the folder, hidden ones included. */
static int entries(void)
{
	DIR *dir = opendir(folder);
	int n = -2;

	while (readdir(dir))
		n++;
	closedir(dir);
	return n;
}

static int tear_down(void **state)
{
	char command[100];

	snprintf(command, sizeof(command), "rm -rf %s", folder);
	return system(command);
}

static const char *content(void)
{
	static char text[100];
	FILE *file = fopen(path, "r");
	size_t n;

	if (!file)
		return NULL;
	n = fread(text, 1, sizeof(text) - 1, file);
	text[n] = 0;
	fclose(file);
	return text;
}

TEST(test_appears_at_commit, set_up, tear_down)
{
	struct incise_outfile *file = incise_outfile_open(path, NULL);
	struct stat st;
	mode_t mask = umask(0);

	umask(mask);
	assert_non_null(file);
	fputs("whole", incise_outfile_stream(file));
	fflush(incise_outfile_stream(file));
	assert_null(content());
	assert_int_equal(incise_outfile_commit(file, NULL), 0);
	assert_string_equal(content(), "whole");
	assert_int_equal(entries(), 1);
	assert_int_equal(stat(path, &st), 0);
	assert_int_equal(st.st_mode & 0777, 0666 & ~mask);
}

TEST(test_abort_keeps_the_old, set_up, tear_down)
{
	struct incise_outfile *file;

	file = incise_outfile_open(path, NULL);
	fputs("old", incise_outfile_stream(file));
	assert_int_equal(incise_outfile_commit(file, NULL), 0);
	file = incise_outfile_open(path, NULL);
	fputs("new", incise_outfile_stream(file));
	incise_outfile_abort(file);
	assert_string_equal(content(), "old");
	assert_int_equal(entries(), 1);
	file = incise_outfile_open(path, NULL);
	fputs("newer", incise_outfile_stream(file));
	assert_int_equal(incise_outfile_commit(file, NULL), 0);
	assert_string_equal(content(), "newer");
	assert_int_equal(entries(), 1);
}

/* kill -9 with half of it written: the old file stands, and nothing else. */
TEST(test_killed_writer, set_up, tear_down)
{
	struct incise_outfile *file = incise_outfile_open(path, NULL);
	pid_t child;
	int status;

	fputs("old", incise_outfile_stream(file));
	assert_int_equal(incise_outfile_commit(file, NULL), 0);
	child = fork();
	if (!child) {
		file = incise_outfile_open(path, NULL);
		fputs("half", incise_outfile_stream(file));
		fflush(incise_outfile_stream(file));
		raise(SIGKILL);
	}
	assert_int_equal(waitpid(child, &status, 0), child);
	assert_true(WIFSIGNALED(status));
	assert_string_equal(content(), "old");
}

/* A file size limit fails writes as a full disk does (EFBIG in place of ENOSPC). */
TEST(test_failed_write, set_up, tear_down)
{
	struct rlimit before, small;
	struct incise_outfile *file = incise_outfile_open(path, NULL);
	char block[4096] = {0};
	int rc;

	signal(SIGXFSZ, SIG_IGN);
	getrlimit(RLIMIT_FSIZE, &before);
	small = (struct rlimit){8192, before.rlim_max};
	setrlimit(RLIMIT_FSIZE, &small);
	for (int i = 0; i < 10; i++)
		fwrite(block, 1, sizeof(block), incise_outfile_stream(file));
	rc = incise_outfile_commit(file, &err);
	setrlimit(RLIMIT_FSIZE, &before);
	assert_true(rc < 0);
	assert_says(err.text, "not written");
	assert_null(content());
	assert_int_equal(entries(), 0);
}

TEST(test_refusals)
{
	static const struct {
		const char *path;
		int code;
	} cases[] = {{"/nonexistent/x", ENOENT}, {"/tmp", EISDIR}, {"", ENOENT}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};

		assert_null(incise_outfile_open(cases[i].path, &err));
		assert_int_equal(err.code, cases[i].code);
	}
}

/* A link goes on being one; the file it leads to is replaced. */
TEST(test_link_is_written_through, set_up, tear_down)
{
	struct incise_outfile *file = incise_outfile_open(path, NULL);
	char link[80], to[80];
	ssize_t n;

	fputs("old", incise_outfile_stream(file));
	assert_int_equal(incise_outfile_commit(file, NULL), 0);
	snprintf(link, sizeof(link), "%s/link", folder);
	assert_int_equal(symlink("file", link), 0);
	file = incise_outfile_open(link, NULL);
	fputs("new", incise_outfile_stream(file));
	assert_int_equal(incise_outfile_commit(file, NULL), 0);
	n = readlink(link, to, sizeof(to));
	assert_int_equal(n, 4);
	assert_string_equal(content(), "new");
}

/* A file that is replaced keeps its mode, owner and group, through a link too. */
TEST(test_mode_and_owner_stay, set_up, tear_down)
{
	static const mode_t modes[] = {0640, 0600, 0664, 0444};
	const bool root = !geteuid();
	struct incise_outfile *file = incise_outfile_open(path, NULL);
	char link[80];
	struct stat st;

	fputs("old", incise_outfile_stream(file));
	assert_int_equal(incise_outfile_commit(file, NULL), 0);
	snprintf(link, sizeof(link), "%s/link", folder);
	assert_int_equal(symlink("file", link), 0);
	for (size_t i = 0; i < sizeof(modes) / sizeof(*modes); i++) {
		/* Others than this process has: only root may give files away. */
		assert_int_equal(
			chown(path, root ? 1234 : geteuid(), root ? 5678 : getegid()), 0);
		assert_int_equal(chmod(path, modes[i]), 0);
		file = incise_outfile_open(i % 2 ? link : path, NULL);
		assert_non_null(file);
		fputs("new", incise_outfile_stream(file));
		assert_int_equal(incise_outfile_commit(file, NULL), 0);
		assert_int_equal(stat(path, &st), 0);
		assert_int_equal(st.st_mode & 07777, modes[i]);
		assert_int_equal(st.st_uid, root ? 1234 : geteuid());
		assert_int_equal(st.st_gid, root ? 5678 : getegid());
	}
	assert_int_equal(lstat(link, &st), 0);
	assert_true(S_ISLNK(st.st_mode));
}

/*
 * Who may not keep the group, as the folder is theirs but the file is not, gives the new group
 * no more than everyone has.
 */
TEST(test_another_group_gets_no_more, set_up, tear_down)
{
	struct incise_outfile *file;
	struct stat st;
	int status;
	pid_t child;
	FILE *old;

	if (geteuid())
		skip(); /* only root makes a file of others */
	assert_int_equal(chown(folder, 1234, 1234), 0);
	old = fopen(path, "w");
	assert_non_null(old);
	fclose(old);
	assert_int_equal(chmod(path, 0664), 0);
	child = fork();
	if (!child) {
		if (setgroups(0, NULL) || setgid(1234) || setuid(1234))
			_exit(2);
		file = incise_outfile_open(path, NULL);
		_exit(!file || incise_outfile_commit(file, NULL));
	}
	assert_int_equal(waitpid(child, &status, 0), child);
	assert_int_equal(status, 0);
	assert_int_equal(stat(path, &st), 0);
	assert_int_equal(st.st_uid, 1234);
	assert_int_equal(st.st_gid, 1234);
	assert_int_equal(st.st_mode & 07777, 0644);
}

/* Devices and pipes are written in place: there is nothing to rename. */
TEST(test_special_files)
{
	struct incise_outfile *file = incise_outfile_open("/dev/null", NULL);
	struct stat st;

	fputs("gone", incise_outfile_stream(file));
	assert_int_equal(incise_outfile_commit(file, NULL), 0);
	assert_int_equal(stat("/dev/null", &st), 0);
	assert_true(S_ISCHR(st.st_mode));
	file = incise_outfile_open("/dev/full", NULL);
	fputs("lost", incise_outfile_stream(file));
	assert_int_equal(incise_outfile_commit(file, &err), -ENOSPC);
}
