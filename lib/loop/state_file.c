// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The file of a state page; see state_file.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "state_file.h"
#include "state_page.h"

/* Names to try: no more loops start at once. */
#define TRIES 100

int incise_state_file_held(int fd)
{
	/* A lock for reading conflicts with a writer's only. */
	struct flock lock = {.l_type = F_RDLCK, .l_whence = SEEK_SET};

	if (fcntl(fd, F_OFD_GETLK, &lock))
		return -errno;
	return lock.l_type != F_UNLCK;
}

static int busy(const char *path, int fd, struct incise_error *err)
{
	struct state_head head;

	if (pread(fd, &head, sizeof(head), 0) != (ssize_t)sizeof(head))
		head.pid = 0;
	return incise_error_set(
		err, EBUSY,
		"%s: another loop uses it, process %lld; stop it, or give another path",
		path, (long long)head.pid);
}

/* 0: there is nothing, or a page that may be replaced. */
static int look_state_file(const char *path, struct incise_error *err)
{
	char magic[sizeof(STATE_MAGIC) - 1];
	struct stat st;
	ssize_t n = 0;
	int fd, rc;

	if (lstat(path, &st))
		return errno == ENOENT ? 0
				       : incise_error_set(err, errno, "%s: %s", path,
							  strerror(errno));
	fd = S_ISREG(st.st_mode)
		     ? open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK)
		     : -1;
	if (fd >= 0)
		n = pread(fd, magic, sizeof(magic), 0);
	/* An empty file may be replaced. */
	if (fd < 0 || n < 0 ||
	    (n && (n < (ssize_t)sizeof(magic) || memcmp(magic, STATE_MAGIC, n))))
		rc = incise_error_set(err, EEXIST,
				      "%s: exists and is not a status file of a loop; "
				      "give another path",
				      path);
	else
		rc = incise_state_file_held(fd) == 1 ? busy(path, fd, err) : 0;
	if (fd >= 0)
		close(fd);
	return rc;
}

/* The n-th hidden name. */
static void try_name(struct incise_state_file *file, unsigned int n)
{
	const char *slash = strrchr(file->path, '/');
	int dir = slash ? (int)(slash - file->path) + 1 : 0;

	snprintf(file->hidden, strlen(file->path) + 9, "%.*s.%s.%06u", dir, file->path,
		 file->path + dir, ((unsigned int)getpid() + n) % 1000000u);
}

static void forget_hidden(struct incise_state_file *file)
{
	free(file->hidden);
	file->hidden = NULL;
}

static int create(struct incise_state_file *file)
{
	char *slash = strrchr(file->path, '/');
	char *dir = slash ? strndup(file->path, (size_t)(slash - file->path) + 1)
			  : strdup(".");
	int fd;

	if (!dir)
		return -ENOMEM;
	fd = open(dir, O_TMPFILE | O_RDWR | O_CLOEXEC, 0644);
	free(dir);
	for (unsigned int n = 0; fd < 0 && n < TRIES; n++) {
		if (!file->hidden)
			file->hidden = malloc(strlen(file->path) + 9);
		if (!file->hidden)
			return -ENOMEM;
		try_name(file, n);
		fd = open(file->hidden, O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, 0644);
		if (fd < 0 && errno != EEXIST)
			break;
	}
	if (fd < 0 && file->hidden) {
		int rc = -errno;

		forget_hidden(file);
		return rc;
	}
	file->fd = fd;
	return 0;
}

static int fill_state_file(struct incise_state_file *file, size_t size)
{
	struct flock lock = {.l_type = F_WRLCK, .l_whence = SEEK_SET};
	int rc;

	/* Anybody may read it, whatever the umask. */
	if (fchmod(file->fd, 0644) || fcntl(file->fd, F_OFD_SETLK, &lock))
		return -errno;
	/* A full disk is an error now rather than a page that is not written later. */
	rc = posix_fallocate(file->fd, 0, (off_t)size);
	return -rc;
}

int incise_state_file_new(struct incise_state_file *file, const char *path, size_t size,
			  struct incise_error *err)
{
	int rc;

	*file = (struct incise_state_file){.fd = -1};
	rc = look_state_file(path, err);
	if (rc)
		return rc;
	file->path = strdup(path);
	rc = file->path ? create(file) : -ENOMEM;
	if (!rc)
		rc = fill_state_file(file, size);
	if (rc) {
		incise_state_file_close(file);
		return incise_error_set(
			err, -rc,
			"%s: the status file cannot be created: %s; give another path",
			path, strerror(-rc));
	}
	return 0;
}

/* Give an unnamed file a hidden name. */
static int name_hidden(struct incise_state_file *file)
{
	char proc[32];

	if (file->hidden)
		return 0;
	file->hidden = malloc(strlen(file->path) + 9);
	if (!file->hidden)
		return -ENOMEM;
	snprintf(proc, sizeof(proc), "/proc/self/fd/%d", file->fd);
	for (unsigned int n = 0; n < TRIES; n++) {
		try_name(file, n);
		if (!linkat(AT_FDCWD, proc, AT_FDCWD, file->hidden, AT_SYMLINK_FOLLOW))
			return 0;
		if (errno != EEXIST)
			break;
	}
	forget_hidden(file);
	return -errno;
}

/*
 * The previous file has the hidden name now. If another loop put it at the path meanwhile, it
 * gets its name back.
 */
static int swapped(struct incise_state_file *file, struct incise_error *err)
{
	int rc = look_state_file(file->hidden, NULL);

	if (!rc)
		return 0;
	renameat2(AT_FDCWD, file->hidden, AT_FDCWD, file->path, RENAME_EXCHANGE);
	return incise_error_set(
		err, -rc,
		"%s: another loop is starting with it; stop it, or give another path",
		file->path);
}

int incise_state_file_publish(struct incise_state_file *file, struct incise_error *err)
{
	int rc = name_hidden(file);

	if (rc)
		goto failed;
	for (int n = 0; n < TRIES; n++) {
		/* If there is a file already, exchange it, so that it can still be checked. */
		if (!renameat2(AT_FDCWD, file->hidden, AT_FDCWD, file->path,
			       RENAME_NOREPLACE)) {
			forget_hidden(file);
			return 0;
		}
		if (errno == EEXIST && !renameat2(AT_FDCWD, file->hidden, AT_FDCWD,
						  file->path, RENAME_EXCHANGE)) {
			rc = swapped(file, err);
			unlink(file->hidden);
			forget_hidden(file);
			return rc;
		}
		if (errno != EEXIST && errno != ENOENT)
			break;
	}
	rc = -errno;
	/* The file system has no such flags. */
	if ((rc == -EINVAL || rc == -ENOSYS) && !rename(file->hidden, file->path)) {
		forget_hidden(file);
		return 0;
	}
failed:
	return incise_error_set(err, -rc, "%s: cannot be created: %s; give another path",
				file->path, strerror(-rc));
}

int incise_state_file_write(const struct incise_state_file *file, size_t offset,
			    const void *from, size_t size)
{
	const char *bytes = from;

	while (size) {
		ssize_t n = pwrite(file->fd, bytes, size, (off_t)offset);

		if (n < 0 && errno == EINTR)
			continue;
		if (n <= 0)
			return n ? -errno : -EIO;
		bytes += n;
		offset += (size_t)n;
		size -= (size_t)n;
	}
	return 0;
}

bool incise_state_file_short(int fd, size_t size)
{
	struct stat st;

	return !fstat(fd, &st) && st.st_size < (off_t)size;
}

void incise_state_file_close(struct incise_state_file *file)
{
	if (file->hidden)
		unlink(file->hidden);
	if (file->fd >= 0)
		close(file->fd);
	free(file->hidden);
	free(file->path);
	*file = (struct incise_state_file){.fd = -1};
}
