"""First bytes that are not meant for a telescope port, typed from the specifications of protocols and nmap's probes."""

from __future__ import annotations

_FORM = b"#:Sr04:00:00#:Sd+40*00:00#:MS#"
_BROWSER = b"Host: 127.0.0.1:4030\r\nConnection: keep-alive\r\nUser-Agent: Mozilla/5.0 (X11; Linux x86_64)\r\n"

#: Name -> all of the bytes that arrive.
GREETINGS: dict[str, bytes] = {
    "a visit": b"GET /x HTTP/1.1\r\n" + _BROWSER + b"Accept: text/html,*/*;q=0.8\r\n\r\n",
    "Prometheus": b"GET /metrics HTTP/1.1\r\nHost: scope:4030\r\nUser-Agent: Prometheus/2.45.0\r\n\r\n",
    "a form": b"POST / HTTP/1.1\r\n" + _BROWSER + b"Content-Type: text/plain\r\nContent-Length: 30\r\n\r\n" + _FORM,
    "a look": b"HEAD / HTTP/1.0\r\n\r\n",
    "a preflight": b"OPTIONS / HTTP/1.1\r\n" + _BROWSER + b"Origin: null\r\n\r\n",
    "a WebDAV folder": b"PROPFIND / HTTP/1.1\r\nHost: scope\r\nDepth: 1\r\nContent-Length: 0\r\n\r\n",
    "a WebDAV new folder": b"MKCOL /xyz/ HTTP/1.1\r\nHost: scope\r\n\r\n",
    "a WebDAV deletion": b"DELETE /exp HTTP/1.1\r\nHost: scope\r\n\r\n",
    "a WebDAV merge": b"MERGE /exp HTTP/1.1\r\nHost: scope\r\n\r\n",
    "a WebDAV lock": b"LOCK /exp HTTP/1.1\r\nHost: scope\r\n\r\n",
    "a trace": b"TRACE / HTTP/1.1\r\nHost: scope\r\nMax-Forwards: 3\r\n\r\n",
    "a search of the network": b'M-SEARCH * HTTP/1.1\r\nHOST: 239.255.255.250:1900\r\nMAN: "ssdp:discover"\r\n\r\n',
    "a notice on the network": b"NOTIFY * HTTP/1.1\r\nHOST: 239.255.255.250:1900\r\nNT: upnp:rootdevice\r\n\r\n",
    "a method of a page's own": b"X / HTTP/1.1\r\n" + _BROWSER + b"Content-Length: 30\r\n\r\n" + _FORM,
    "a method that is a command": b"E /R34AB,12CE HTTP/1.1\r\n" + _BROWSER + b"\r\nR34AB,12CE",
    "a method in small letters": b"patch /r34AB0500,12CE0500 HTTP/1.1\r\n" + _BROWSER + b"\r\n" + _FORM,
    "a long method": b"E" * 2000 + b" /R34AB,12CE HTTP/1.1\r\n" + _BROWSER + b"\r\n" + _FORM,
    "HTTP/2": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\x12\4\0\0\0\0\0\0\3\0\0\0\x64\0\4\0\0\xff\xff",
    "TLS": b"\x16\3\1\0\xc8\1\0\0\xc4\3\3" + bytes(range(64, 96)) + b"\x20xyuTMLExyuT\2" + b"\x13\1\x13\2#:MS#",
    "SSH": b"SSH-2.0-OpenSSH_9.2p1 Debian-2+deb12u2\r\n",
    "SOCKS 4": b"\4\1\0\x50\x7f\0\0\1xyu\0",
    "SOCKS 5": b"\5\2\0\2",
    "RTSP": b"DESCRIBE rtsp://scope:4030/exyu RTSP/1.0\r\nCSeq: 2\r\n\r\n",
    "RTSP, setting up": b"SETUP rtsp://scope/exyu RTSP/1.0\r\nCSeq: 3\r\n\r\n",
    "SMB": b"\0\0\0\xa4\xffSMBr\0\0\0\0\x08\1@" + b"\0" * 14 + b"\x40\6\0\0\1\0\0\x81\0\2PC NETWORK PROGRAM 1.0\0",
    "SMB 2": b"\0\0\0\x66\xfeSMB\x40\0\1\0" + b"\0" * 40,
    "SIP": b"REGISTER sip:scope SIP/2.0\r\nVia: SIP/2.0/TCP 127.0.0.1;branch=exyu\r\n\r\n",
    "SIP, a probe": b"OPTIONS sip:nm SIP/2.0\r\nVia: SIP/2.0/TCP nm;branch=foo\r\nFrom: <sip:nm@nm>;tag=root\r\n\r\n",
    "SMTP": b"EHLO xyu.example\r\nMAIL FROM:<x@example>\r\n",
    "SMTP, older": b"HELO xyu.example\r\n",
    "TURN over TCP": b"\0\3\0\x24\x21\x12\xa4\x42" + b"exyuT\2exyuTM" + b"\0\x19\0\4\x11\0\0\0",
    "STUN over TCP": b"\0\1\0\0\x21\x12\xa4\x42" + b"exyuT\2exyuTM",
    "STUN framed, of a web page": b"\0\x58\0\1\0\x44\x21\x12\xa4\x42" + b"exyuT\2exyuTM" + b"\0\6\0\5x:exu\0\0\0",
    "JSON": b'{"method": "exyu", "params": ["T\2"], "id": 1}\r\n',
    "JSON, a list": b'[{"jsonrpc": "2.0", "method": "exyu"}]\r\n',
    "nmap, help": b"HELP\r\n",
    "nmap, RTSP": b"OPTIONS / RTSP/1.0\r\n\r\n",
    "nmap, RPC": b"\x80\0\0\x28\x72\xfe\x1d\x13\0\0\0\0\0\0\0\2\0\1\x86\xa0\0\1\x97\x7c" + b"\0" * 20,
    "nmap, DNS": b"\0\x1e\0\6\1\0\0\1\0\0\0\0\0\0\7version\4bind\0\0\x10\0\3",
    "nmap, DNS status": b"\0\x0c\0\0\x10\0\0\0\0\0\0\0\0\0",
    "nmap, Kerberos": b"\0\0\0\x71\x6a\x81\x6e\x30\x81\x6b\xa1\3\2\1\5\xa2\3\2\1\x0a\xa4\x81\x5e\x30\x5c\xa0\7\3\5",
    "nmap, LDAP": b"\x30\x0c\2\1\1\x60\7\2\1\2\4\0\x80\0",
    "nmap, X11": b"\x6c\0\x0b\0\0\0\0\0\0\0\0\0",
    "nmap, Java": b"JRMI\0\2K",
    "nmap, LANDesk": b"TNMP\4\0\0\0TNME\0\0\4\0",
    "nmap, NetWare": b"DmdT\0\0\0\x17\0\0\0\1\0\0\0\0\x11\x11\0\xff\1\xff\x13",
    "nmap, Notes": b":\0\0\0/\0\0\0\2\0\0@\2\x0f\0\1\0=\5\0\0\0\0\0\0\0\0\0\0\0\0/\0\0\0",
    "nmap, WWWOFFLE": b"WWWOFFLE STATUS\r\n",
    "a remote desktop": b"\3\0\0\x0b\6\xe0\0\0\0\0\0",
    "XML": b'<?xml version="1.0"?><methodCall><methodName>exyu</methodName></methodCall>',
}
#: Only for ports that do not speak Telnet themselves.
TELNET = b"\xff\xfd\3\xff\xfb\x18\xff\xfb\x1f\xff\xfb\x20xyu\r\n"
