// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/loop/state_file.c: paths that may be replaced, and the lock of a living writer. */
#include "../unit.h"
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include "../../../lib/loop/state_file.h"
#include "state_made.h"

static void put(const char *path, const char *text)
{
	FILE *file = fopen(path, "w");

	assert_non_null(file);
	fputs(text, file);
	fclose(file);
}

static ino_t inode(const char *path)
{
	struct stat st;

	assert_int_equal(stat(path, &st), 0);
	return st.st_ino;
}

TEST(test_a_second_writer_is_refused, made_page, made_end)
{
	char pid[32];

	snprintf(pid, sizeof(pid), "process %d", (int)getpid());
	assert_error(incise_state_new(made.path, &made_setup, &err), EBUSY, &err, pid);
}

TEST(test_a_dead_one_is_replaced, made_page, made_end)
{
	ino_t old = inode(made.path);
	struct incise_state *reader = incise_state_open(made.path, NULL);

	incise_state_free(made.writer);
	/* The page stays, and readers keep its last state. */
	assert_int_equal(inode(made.path), old);
	made.writer = incise_state_new(made.path, &made_setup, NULL);
	assert_non_null(made.writer);
	assert_int_not_equal(inode(made.path), old);
	assert_int_equal(incise_state_alive(reader), 0);
	incise_state_close(reader);
	reader = incise_state_open(made.path, NULL);
	assert_int_equal(incise_state_alive(reader), 1);
	incise_state_close(reader);
}

/* The lock goes with the process, however it ends. */
TEST(test_killed, made_folder, made_end)
{
	struct incise_state *reader;
	int ready[2], status;
	pid_t child;
	char c;

	assert_int_equal(pipe(ready), 0);
	child = fork();
	if (!child) {
		if (incise_state_new(made.path, &made_setup, NULL))
			write(ready[1], "", 1);
		close(ready[1]);
		pause();
		_exit(0);
	}
	close(ready[1]);
	assert_int_equal(read(ready[0], &c, 1), 1);
	close(ready[0]);
	reader = incise_state_open(made.path, NULL);
	assert_non_null(reader);
	assert_int_equal(incise_state_alive(reader), 1);
	assert_null(incise_state_new(made.path, &made_setup, NULL));
	assert_int_equal(errno, EBUSY);
	kill(child, SIGKILL);
	assert_int_equal(waitpid(child, &status, 0), child);
	assert_int_equal(incise_state_alive(reader), 0);
	incise_state_close(reader);
	made.writer = incise_state_new(made.path, &made_setup, NULL);
	assert_non_null(made.writer);
}

/* A reader's lock does not count as a writer's. */
TEST(test_readers_do_not_hold_it, made_page, made_end)
{
	struct flock lock = {.l_type = F_RDLCK, .l_whence = SEEK_SET};
	int fd = open(made.path, O_RDONLY);

	assert_true(fd >= 0);
	incise_state_free(made.writer);
	assert_int_equal(fcntl(fd, F_OFD_SETLK, &lock), 0);
	assert_int_equal(incise_state_file_held(fd), 0);
	made.writer = incise_state_new(made.path, &made_setup, NULL);
	assert_non_null(made.writer);
	close(fd);
}

TEST(test_what_is_no_page_is_kept, made_folder, made_end)
{
	static const char *const texts[] = {"rate_hz = 1000.0;", "INCSTAT", "x"};
	char other[300];

	for (size_t i = 0; i < sizeof(texts) / sizeof(*texts); i++) {
		ino_t old;

		put(made.path, texts[i]);
		old = inode(made.path);
		assert_null(incise_state_new(made.path, &made_setup, NULL));
		assert_int_equal(errno, EEXIST);
		assert_int_equal(inode(made.path), old);
	}
	unlink(made.path);
	assert_int_equal(mkdir(made.path, 0755), 0);
	assert_null(incise_state_new(made.path, &made_setup, NULL));
	assert_int_equal(errno, EEXIST);
	rmdir(made.path);
	snprintf(other, sizeof(other), "%s/other", made.dir);
	put(other, "kept");
	assert_int_equal(symlink(other, made.path), 0);
	assert_null(incise_state_new(made.path, &made_setup, NULL));
	assert_int_equal(errno, EEXIST);
	unlink(made.path);
	unlink(other);
	/* An empty file is replaced. */
	put(made.path, "");
	made.writer = incise_state_new(made.path, &made_setup, NULL);
	assert_non_null(made.writer);
}

/* Two that start at once: both found nothing, or a page with a dead writer. */
TEST(test_two_at_once, made_folder, made_end)
{
	for (int dead = 0; dead < 2; dead++) {
		struct incise_state_file a, b;
		ino_t first;

		if (dead)
			incise_state_free(incise_state_new(made.path, &made_setup, NULL));
		assert_int_equal(incise_state_file_new(&a, made.path, 4096, NULL), 0);
		assert_int_equal(incise_state_file_new(&b, made.path, 4096, NULL), 0);
		incise_state_file_write(&a, 0, "INCSTATE", 8);
		incise_state_file_write(&b, 0, "INCSTATE", 8);
		assert_int_equal(incise_state_file_publish(&a, &err), 0);
		first = inode(made.path);
		assert_int_equal(incise_state_file_publish(&b, &err), -EBUSY);
		assert_int_equal(inode(made.path), first);
		incise_state_file_close(&b);
		assert_int_equal(inode(made.path), first);
		incise_state_file_close(&a);
		unlink(made.path);
	}
}

TEST(test_anybody_may_look, made_folder, made_end)
{
	mode_t before = umask(0077);
	struct stat st;

	made.writer = incise_state_new(made.path, &made_setup, NULL);
	umask(before);
	assert_int_equal(stat(made.path, &st), 0);
	assert_int_equal(st.st_mode & 07777, 0644);
	/* No holes: a full disk is found out at the start. */
	assert_true(st.st_blocks * 512 >= st.st_size);
}

TEST(test_places_that_are_none)
{
	struct incise_state_setup setup = made_setup;
	static const double rates[] = {0, -1, 1.0 / 0.0};

	assert_error(incise_state_new("/nosuch/folder/a.state", &made_setup, &err),
		     ENOENT, &err, "/nosuch/folder/a.state");
	assert_null(incise_state_new("/proc/a.state", &made_setup, &err));
	assert_int_not_equal(errno, 0);
	for (size_t i = 0; i < 3; i++) {
		setup.rate_hz = rates[i];
		assert_null(incise_state_new("/tmp/a.state", &setup, &err));
		assert_int_equal(errno, EINVAL);
	}
}
