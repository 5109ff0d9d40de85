// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The file of a haptic device's page: its name, its locks and its head; see haptic_page.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../base/crc32c.h"
#include "haptic_page.h"

#define NAME_MOST 60
#define NAME_CHARACTERS "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-"

_Static_assert(sizeof(struct incise_haptic_page) == 5696 &&
		       offsetof(struct incise_haptic_page, ring) == 1600 &&
		       offsetof(struct incise_haptic_page, user) == 1472 &&
		       offsetof(struct incise_haptic_page, owner) == 1152,
	       "the layout of version 1");

/* "haply:0" becomes haply-0-1a2b3c4d. */
static int name_page(struct haptic_page *page, const char *device, const char *where,
		     struct incise_error *err)
{
	size_t local = strlen(HAPTIC_PAGE_LOCAL);
	const char *name = device + local;
	char words[41];

	*page = (struct haptic_page){.fd = -1};
	if (!strncmp(device, HAPTIC_PAGE_LOCAL, local)) {
		if (!*name || strspn(name, NAME_CHARACTERS) != strlen(name) ||
		    strlen(name) > NAME_MOST)
			return incise_error_set(
				err, EINVAL,
				"%s: local:%.80s: expected local:NAME, at most %d letters, "
				"digits, - and _; correct it",
				where, name, NAME_MOST);
		snprintf(page->path, sizeof(page->path), "/dev/shm/incise-%s", name);
		return 0;
	}
	snprintf(words, sizeof(words), "%s", device);
	for (char *c = words; *c; c++)
		if (!strchr(NAME_CHARACTERS, *c))
			*c = '-';
	snprintf(page->path, sizeof(page->path), "/dev/shm/incise-%s-%08x", words,
		 incise_crc32c(0, device, strlen(device)));
	return 0;
}

static int lock_byte(int fd, int byte)
{
	struct flock lock = {.l_type = F_WRLCK, .l_start = byte, .l_len = 1};

	return fcntl(fd, F_OFD_SETLK, &lock) ? -EBUSY : 0;
}

bool incise_haptic_page_held(const struct haptic_page *page, int byte)
{
	struct flock lock = {.l_type = F_WRLCK, .l_start = byte, .l_len = 1};

	return !fcntl(page->fd, F_OFD_GETLK, &lock) && lock.l_type != F_UNLCK;
}

/* Open what has the page's name. Another user's is of no use, be it a trap or a mistake. */
static int open_own(struct haptic_page *page)
{
	struct stat st;

	page->fd = open(page->path, O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
	if (page->fd < 0)
		return -errno;
	if (fstat(page->fd, &st))
		return -errno;
	return S_ISREG(st.st_mode) && st.st_uid == geteuid() ? 0 : -EACCES;
}

static bool has_name(const struct haptic_page *page)
{
	struct stat own, named;

	return !fstat(page->fd, &own) && !lstat(page->path, &named) &&
	       own.st_dev == named.st_dev && own.st_ino == named.st_ino;
}

static int map_page(struct haptic_page *page)
{
	void *map = mmap(NULL, sizeof(*page->map), PROT_READ | PROT_WRITE,
			 MAP_SHARED | MAP_POPULATE, page->fd, 0);

	page->map = map == MAP_FAILED ? NULL : map;
	return page->map ? 0 : -errno;
}

void incise_haptic_page_close(struct haptic_page *page, bool remove)
{
	if (page->map)
		munmap(page->map, sizeof(*page->map));
	/* With the lock no other owner can have put a page of its own there. */
	if (page->fd >= 0 && remove && has_name(page))
		unlink(page->path);
	if (page->fd >= 0)
		close(page->fd);
	page->map = NULL;
	page->fd = -1;
}

/* @busy: the meaning of -EBUSY. */
static int report_page(const struct haptic_page *page, int rc, const char *busy,
		       const char *where, struct incise_error *err)
{
	return incise_error_set(
		err, rc == -EOWNERDEAD ? ENOENT : -rc, "%s: %s: %s", where, page->path,
		rc == -EBUSY	? busy
		: rc == -ENOENT ? "no process serves this device; start it"
		: rc == -EOWNERDEAD
			? "nobody holds its lock of byte 0: its owner has died, or holds "
			  "none (F_OFD_SETLK); start it again"
		: rc == -EACCES ? "another user's; run as that user"
		: rc == -EPROTO ? "not a page of version 1 of incise/haptic_page.h; "
				  "build the device's process for it"
		: rc == -EAGAIN ? "its owner has not written the magic yet: it opens its "
				  "device, or does not get ready"
				: strerror(-rc));
}

/* --- the owner's ------------------------------------------------------------------------ */

static int remove_dead(struct haptic_page *page)
{
	int rc = open_own(page);

	if (!rc)
		rc = lock_byte(page->fd, INCISE_HAPTIC_PAGE_OWNER_BYTE);
	incise_haptic_page_close(page, !rc);
	return rc == -ENOENT ? 0 : rc;
}

static int make_page(struct haptic_page *page)
{
	int rc = remove_dead(page);

	if (rc)
		return rc;
	page->fd = open(page->path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
	/* Another owner came first. */
	if (page->fd < 0)
		return errno == EEXIST ? -EBUSY : -errno;
	if (lock_byte(page->fd, INCISE_HAPTIC_PAGE_OWNER_BYTE) || !has_name(page))
		return -EBUSY;
	rc = posix_fallocate(page->fd, 0, sizeof(*page->map));
	return rc ? -rc : map_page(page);
}

int incise_haptic_page_new(struct haptic_page *page, const char *device,
			   const char *where, struct incise_error *err)
{
	int rc = name_page(page, device, where, err);

	if (rc)
		return rc;
	rc = make_page(page);
	if (!rc)
		return 0;
	incise_haptic_page_close(page, false);
	return report_page(
		page, rc,
		"the device has an owner already; end that process, or use the "
		"device through it",
		where, err);
}

/* --- the user's ------------------------------------------------------------------------- */

/* 0; -EAGAIN: its owner has not finished it; -EOWNERDEAD: nobody holds its lock; -EPROTO. */
static int look_at_head(const struct haptic_page *page)
{
	struct incise_haptic_page own;
	const size_t parts = offsetof(struct incise_haptic_page_head, device);
	const size_t end = offsetof(struct incise_haptic_page_head, reserved);
	struct incise_haptic_page_head head = {0};
	struct stat st;
	bool whole = pread(page->fd, &head, sizeof(head), 0) == (ssize_t)sizeof(head) &&
		     head.magic[0];

	incise_haptic_page_publish(&own, 0);
	if (!incise_haptic_page_held(page, INCISE_HAPTIC_PAGE_OWNER_BYTE))
		return -EOWNERDEAD;
	if (!whole)
		return -EAGAIN;
	if (memcmp(head.magic, own.head.magic, sizeof(own.head.magic)) ||
	    head.major != own.head.major || head.size != own.head.size ||
	    fstat(page->fd, &st) || st.st_size < (off_t)own.head.size ||
	    memcmp((char *)&head + parts, (char *)&own.head + parts, end - parts))
		return -EPROTO;
	return 0;
}

static int take_page(struct haptic_page *page)
{
	int rc = open_own(page);

	if (!rc)
		rc = look_at_head(page);
	if (!rc)
		rc = lock_byte(page->fd, INCISE_HAPTIC_PAGE_USER_BYTE);
	return rc ? rc : map_page(page);
}

int incise_haptic_page_open(struct haptic_page *page, const char *device,
			    const char *where, struct incise_error *err)
{
	int rc = name_page(page, device, where, err);

	if (rc)
		return rc;
	rc = take_page(page);
	if (!rc)
		return 0;
	incise_haptic_page_close(page, false);
	return report_page(page, rc, "another program uses the device; end it", where,
			   err);
}

uint32_t incise_haptic_page_settings(const struct incise_haptic_setup *setup)
{
	/* Without the padding at its end. */
	return incise_crc32c(0, setup,
			     offsetof(struct incise_haptic_setup, n_motor_torques) +
				     sizeof(int));
}
