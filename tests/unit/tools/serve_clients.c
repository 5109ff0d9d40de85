// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of tools/serve/clients.c with sockets of this process as peers: messages of a round leave in
 * one system call, in order to the byte however the socket takes them, and one client too many is
 * answered.
 */
#include "../unit.h"
#include <netinet/in.h>
#include <sys/socket.h>
#include "../../../tools/cli/cli.h"
#include "../../../tools/serve/clients.h"

/* The system calls that send; each takes at most so many bytes, 0: all that the socket takes. */
static int calls;
static size_t most;

ssize_t __real_sendmsg(int fd, const struct msghdr *message, int flags);
ssize_t __wrap_sendmsg(int fd, const struct msghdr *message, int flags)
{
	calls++;
	if (!most)
		return __real_sendmsg(fd, message, flags);
	/* Every third finds the socket full. */
	if (calls % 3 == 0) {
		errno = EAGAIN;
		return -1;
	}
	return send(fd, message->msg_iov->iov_base,
		    message->msg_iov->iov_len < most ? message->msg_iov->iov_len : most,
		    flags);
}

static struct clients *clients;
static struct client *newest;
static int opened, port;

static void *open_one(void *context, struct client *client)
{
	newest = client;
	opened++;
	return &opened;
}

static const char *receive_none(void *context, struct client *client, void *user,
				const uint8_t *bytes, size_t n)
{
	return NULL;
}

static bool is_inside(void *user)
{
	return false;
}

static void close_one(void *user)
{
}

static size_t refuse_one(void *context, uint8_t *bytes, size_t capacity)
{
	memcpy(bytes, "busy", 4);
	return 4;
}

static int begin(void **state)
{
	static const struct clients_setup setup = {
		.address = "127.0.0.1:0",
		.idle_s = 1e6,
		.opened = open_one,
		.received = receive_none,
		.inside = is_inside,
		.closed = close_one,
		.full = refuse_one,
	};

	clients = clients_new(&setup);
	port = atoi(strrchr(clients_address(clients), ':') + 1);
	calls = opened = 0;
	most = 0;
	return 0;
}

static int end(void **state)
{
	clients_free(clients);
	return 0;
}

static int connect_peer(void)
{
	const struct sockaddr_in to = {.sin_family = AF_INET,
				       .sin_port = htons((uint16_t)port),
				       .sin_addr = {htonl(INADDR_LOOPBACK)}};
	int fd = socket(AF_INET, SOCK_STREAM, 0);

	assert_int_equal(connect(fd, (const struct sockaddr *)&to, sizeof(to)), 0);
	return fd;
}

/* A peer that is accepted; the kernel may take its time. */
static int accepted_peer(void)
{
	int fd = connect_peer(), before = opened;

	while (opened == before)
		clients_work(clients);
	return fd;
}

/* Message @i has i + 1 bytes of its number. */
static void send_numbered(int from, int to)
{
	for (int i = from; i < to; i++) {
		struct message *message = message_new(i % 3, false, (size_t)i + 1);

		memset(message_bytes(message), i, (size_t)i + 1);
		clients_send(newest, message);
		message_drop(message);
	}
}

static void receive_numbered(int fd, int from, int to)
{
	uint8_t bytes[256];

	for (int i = from; i < to; i++) {
		assert_int_equal(recv(fd, bytes, (size_t)i + 1, MSG_WAITALL), i + 1);
		for (int k = 0; k <= i; k++)
			assert_int_equal(bytes[k], i);
	}
}

TEST(messages_of_a_round_leave_in_one_call, begin, end)
{
	int fd = accepted_peer();

	for (int round = 0; round < 5; round++) {
		send_numbered(3 * round, 3 * round + 3);
		assert_int_equal(calls, round);
		assert_false(clients_are_empty(clients));
		clients_flush(clients);
		assert_int_equal(calls, round + 1);
		assert_true(clients_are_empty(clients));
		receive_numbered(fd, 3 * round, 3 * round + 3);
	}
	clients_flush(clients);
	assert_int_equal(calls, 5);
	close(fd);
}

/* As many as a fast recording has in a round: more than may wait. */
TEST(none_is_lost_for_want_of_a_flush, begin, end)
{
	int fd = accepted_peer();

	for (int i = 0; i < 10; i++)
		send_numbered(0, 100);
	clients_flush(clients);
	for (int i = 0; i < 10; i++)
		receive_numbered(fd, 0, 100);
	close(fd);
}

TEST(parts_of_messages_come_in_order, begin, end)
{
	int fd = accepted_peer();

	most = 7;
	send_numbered(0, 60);
	while (!clients_are_empty(clients))
		clients_work(clients);
	receive_numbered(fd, 0, 60);
	close(fd);
}

TEST(one_too_many_is_answered, begin, end)
{
	int fd[CLIENTS_MOST], late;
	char answer[8];

	for (int i = 0; i < CLIENTS_MOST; i++)
		fd[i] = accepted_peer();
	late = connect_peer();
	/* It asks before it is answered, and the answer comes all the same. */
	assert_int_equal(send(late, "?", 1, 0), 1);
	while (recv(late, answer, 1, MSG_PEEK | MSG_DONTWAIT) < 0)
		clients_work(clients);
	assert_int_equal(recv(late, answer, sizeof(answer), MSG_WAITALL), 4);
	assert_memory_equal(answer, "busy", 4);
	assert_int_equal(opened, CLIENTS_MOST);
	close(late);
	/* A place is free again. */
	close(fd[0]);
	while (opened == CLIENTS_MOST) {
		late = connect_peer();
		clients_work(clients);
		close(late);
	}
	for (int i = 1; i < CLIENTS_MOST; i++)
		close(fd[i]);
}
