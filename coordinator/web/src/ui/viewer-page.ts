/**
 * The page of a package alone: in a folder of any web server beside its `package/`, and for `kiln view`. It asks nothing but the package's
 * files.
 */

import '../viewer/element.ts';
import './theme.css';
import './content.css';
import './panel.css';
import './viewing.css';
import type { ErrorDetail, KilnViewerElement } from '../viewer/api.ts';
import { Notice } from './announcer.ts';
import { byId, installSkipLink, setText } from './dom.ts';
import { inspectorPanel } from './inspector.ts';
import { packageUrl } from './package-url.ts';

const notice = new Notice();
/** Whether this browser has WebGL 2, which a viewer tells when it is put into the page: there is nothing to inspect without it. */
let able = true;
const viewer = document.createElement('kiln-viewer') as KilnViewerElement;
viewer.setAttribute('camera-controls', '');
viewer.alt = 'Baked scene';
viewer.addEventListener('error', (event) => {
  able &&= (event as Event as CustomEvent<ErrorDetail>).detail.type !== 'webgl';
});
viewer.addEventListener('model', () => {
  const { model } = viewer;
  if (!model) return;
  const { nTheta, nPhi } = model.grid;
  const parts = [`${model.surfaces.length} surfaces`, `${model.triangles.toLocaleString('en')} triangles`, `${nTheta} × ${nPhi} directions`, model.codec];
  setText(byId('about-package'), parts.join(', '));
});

byId('needs-server').remove();
installSkipLink();
byId('notices').append(notice.element);
byId('view').append(viewer);
if (able) byId('side').append(inspectorPanel(viewer, () => 'kiln'));
const url = packageUrl(location.search, document.baseURI);
if (url) viewer.src = url;
else notice.show({ role: 'alert', text: 'The address names a package of another site, which this page does not load. Give a path of this site as ?src=.' });
